"""The systems, a folder per family; `registry` declares each of them once."""
