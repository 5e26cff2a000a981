"""A configuration of the whole pipeline in which every stage takes seconds: what `make kills` runs."""

SHORT = {"steps": 6, "batch_size": 4, "validate_every": 2}
TRAINED = {
    "autoencoder": {"width": 8, "code_dim": 8},
    "tokenizer": {"codebook_size": 8, "code_dim": 8, "width": 8, "fine_width": 8},
    "evaluator": {"text_width": 8, "motion_width": 8, "dim": 8},
    "joint_evaluator": {"width": 8, "num_layers": 1, "num_heads": 2, "dim": 8},
    "motion2text": {"width": 16, "num_layers": 1, "dim_feedforward": 16, "num_heads": 2, "offsets": 1, "ensemble": 1},
    "text2token": {"text_width": 8, "width": 16},
    "inverse_alignment": {},
    "text2length": {"text_width": 8},
    "text2motion": {"text_width": 8, "width": 16, "attention_width": 8, "latent": 4},
    "temos": {"latent": 8, "num_layers": 1, "num_heads": 2, "dim_feedforward": 8},
    "residual_tokenizer": {
        "codebook_size": 8, "num_quantizers": 2, "code_dim": 8, "width": 8, "fine_width": 8, "encoder_blocks": 1,
        "decoder_blocks": 1,
    },
    "masked_generator": {
        "width": 8, "word_dim": 8, "num_layers": 1, "detail_layers": 1, "num_heads": 2, "dim_feedforward": 8,
    },
    "masked_autoregression": {
        "components": 4, "width": 8, "word_dim": 8, "num_layers": 1, "num_heads": 2, "dim_feedforward": 8,
        "head_width": 8, "head_blocks": 1,
    },
    "latents": {"width": 8, "code_dim": 8},
    "global_motion": {"width": 8},
    "stylization": {"width": 8, "content_dim": 4, "style_dim": 4},
    "style_evaluator": {"width": 8, "dim": 4, "window": 64},
    "action_evaluator": {"kinds": ["coarse"], "width": 8, "dim": 4, "window": 40},
    "action2motion": {
        "variants": ["glmi_m", "plain"], "width": 8, "latent": 4, "upstream": 4, "generator_layers": 1, "window": 40,
    },
}  # fmt: skip
REST = {
    "scale": "micro",
    "data": {"clips": 48, "mirror": False, "workers": 1, "ratios": [0.5, 0.2, 0.3]},
    "evaluation": {
        "repetitions": 2, "pool": 4, "diversity_pairs": 4, "multimodality_texts": 2, "multimodality_samples": 4,
        "multimodality_pairs": 2, "prompt_samples": 1, "bert_score": False, "batch_size": 8,
        "position_samples": 2,
    },
    "style_evaluation": {"repetitions": 2, "contents": 2, "diversity_contents": 1, "diversity_samples": 2, "codes": 20},
    "action_evaluation": {
        "repetitions": 2, "samples": 8, "diversity_pairs": 4, "multimodality_pairs": 2, "locomotion_samples": 4,
        "physics_motions": 4,
    },
    "report": {"examples": 1},
}  # fmt: skip
