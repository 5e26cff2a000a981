"""What scores the others: evaluator, style evaluator, and retrieval from the corpus."""
