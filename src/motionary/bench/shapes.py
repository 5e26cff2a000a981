"""The shapes that the cases run at: the papers' own, and tiny ones that only show that a case runs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Shapes:
    """Sizes of inputs and models; the defaults are the papers'.

    Attributes:
        clip_frames: of the clip whose features are computed.
        vocabulary: words that models know (about as many as HumanML3D's captions hold).
        windows, window: tokenizer batch, in windows and frames.
        width, codes: channels of the tokenizer, and entries of its codebook (of the same dimension).
        batch: sequences per step of the token models.
        source: motion tokens that motion2text reads, with start and end.
        words: words that a caption's decoder predicts, with the end.
        unrolled: steps that text2token is unrolled for.
        tokens: motion tokens of a whole motion of 196 frames.
        transformer_width, layers, feed_forward, heads: of motion2text.
        text_width, gru_width, word_dim: of text2token; text_width and word_dim also of the evaluator.
        captions, caption_words: motions captioned by beam search, and words of each.
        texts: sentences turned into motions.
        snippet_windows, snippet_window, snippet_width: autoencoder batch, frames, channels.
        style_window, style_width: frames and channels of stylization.
        acted_frames: of a sequence of action2motion.
        pairs, motion_width, embedding: evaluator batch, motion GRU, dimensions of the common space.
        sequences, snippets, latent: text2motion batch, snippet codes that the temporal VAE is unrolled for, dimensions
            of z; its GRUs have gru_width, its text encoder text_width.
        prompts: sentences that the temporal VAE turns into motions of 4 x tokens frames.
        take_frames: of a long take that is read.
        items: rows of the features that R-precision and FID are computed of.
        seconds: length of the motion that is written to files.
        small_width, small_gru_width, small_text_width: of the tokenizer and text2token at `scale=small`.
        temos_frames, temos_tokens: of TEMOS's batch of `sequences` items, at its own 12.5 fps, and a caption's tokens.
        temos_width, temos_layers, temos_inner, temos_heads: of its three Transformers.
        masked_codes, masked_dim, masked_quantizers: of the residual tokenizer; `masked_tokens` of a motion of 5 s.
        masked_width, masked_layers, masked_inner, masked_heads: of each transformer of the masked generator.
        precision: of the products of a training step, "32" or "bf16-mixed".
        matmul: rows of the matrices whose product is a yardstick; `copied` megabytes of memory, the other.
    """

    clip_frames: int = 200
    vocabulary: int = 4000
    windows: int = 128
    window: int = 64
    width: int = 1024
    codes: int = 1024
    batch: int = 64
    source: int = 55
    words: int = 21
    unrolled: int = 54
    tokens: int = 49
    transformer_width: int = 512
    layers: int = 4
    feed_forward: int = 2048
    heads: int = 8
    text_width: int = 512
    gru_width: int = 1024
    word_dim: int = 300
    captions: int = 32
    caption_words: int = 30
    texts: int = 300
    snippet_windows: int = 128
    snippet_window: int = 40
    snippet_width: int = 512
    style_window: int = 160
    style_width: int = 512
    acted_frames: int = 60
    pairs: int = 32
    motion_width: int = 1024
    embedding: int = 512
    sequences: int = 32
    snippets: int = 50
    latent: int = 128
    prompts: int = 32
    items: int = 4000
    seconds: float = 10.0
    take_frames: int = 14_400
    small_width: int = 384
    small_gru_width: int = 512
    small_text_width: int = 256
    temos_frames: int = 100
    temos_tokens: int = 16
    temos_width: int = 256
    temos_layers: int = 6
    temos_inner: int = 1024
    temos_heads: int = 4
    masked_codes: int = 512
    masked_dim: int = 128
    masked_quantizers: int = 4
    masked_tokens: int = 25
    masked_width: int = 192
    masked_layers: int = 4
    masked_inner: int = 768
    masked_heads: int = 6
    precision: str = "32"
    matmul: int = 1536
    copied: int = 64


SMALL = Shapes(
    clip_frames=40, vocabulary=50, windows=4, window=16, width=16, codes=16, batch=4, source=9, words=6, unrolled=8,
    tokens=6, transformer_width=16, layers=1, feed_forward=32, heads=2, text_width=8, gru_width=16, word_dim=8,
    captions=3, caption_words=4, texts=5, snippet_windows=4, snippet_window=16, snippet_width=16, pairs=4,
    motion_width=8, embedding=12, sequences=4, snippets=6, latent=4, prompts=5, items=64, seconds=0.5, matmul=64,
    style_window=32, acted_frames=6, style_width=16, small_width=16, small_gru_width=16, small_text_width=8,
    temos_frames=9, temos_tokens=5, temos_width=8, temos_layers=1, temos_inner=8, temos_heads=2,
    masked_codes=16, masked_dim=8, masked_quantizers=2, masked_tokens=4, masked_width=8, masked_layers=1,
    masked_inner=8, masked_heads=2, take_frames=30, copied=1,
)  # fmt: skip
