"""The result as one page that reads without a network, and as tables for a terminal or a README."""
