"""The dictionary in a browser (viser): `server` serves it, `panel` is what a visitor sees, `figures` and `player` move.

Importing any part of it loads no torch; models are opened behind the page that is already there.
"""
