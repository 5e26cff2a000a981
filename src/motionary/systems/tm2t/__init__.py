"""TM2T: motion tokens, motion to text, text to motion, inverse alignment."""
