"""One system per file: each names its class `MODEL` and its config dataclass `CONFIG`; `io` saves and loads them."""
