"""Captions: normalizing, tagging, mirroring, vocabulary, word vectors and the frozen language model.

The tagger (spaCy) and the language model (transformers) load when first used, never on import.
"""

from motionary.language.annotate import Sentence, annotate, sentence_from_tokens, tagged_tokens
from motionary.language.frozen import PACKAGED, STATE_DIM, model_name, packaged_model, sentence_embeddings
from motionary.language.lexicon import TAGS
from motionary.language.meanings import Meanings
from motionary.language.mirror import mirror_text
from motionary.language.prompt_parts import prompt_parts
from motionary.language.prompt_reading import PromptReading, read
from motionary.language.states import TextStates
from motionary.language.text import check_prompt
from motionary.language.vectors import word_vectors
from motionary.language.vocabulary import END, MAX_WORDS, PAD, START, UNKNOWN, Vocabulary
from motionary.language.written import as_written, written_vocabulary

__all__ = [
    "END",
    "MAX_WORDS",
    "PACKAGED",
    "PAD",
    "START",
    "STATE_DIM",
    "TAGS",
    "UNKNOWN",
    "Meanings",
    "PromptReading",
    "Sentence",
    "TextStates",
    "Vocabulary",
    "annotate",
    "as_written",
    "check_prompt",
    "mirror_text",
    "model_name",
    "packaged_model",
    "prompt_parts",
    "read",
    "sentence_embeddings",
    "sentence_from_tokens",
    "tagged_tokens",
    "word_vectors",
    "written_vocabulary",
]
