"""The papers' evaluation protocol, for any system that generates, captions or reconstructs motion."""
