"""From folders of captioned motion to a memory-mapped corpus and its batches."""
