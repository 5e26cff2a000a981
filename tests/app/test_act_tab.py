"""The page's tab for actions, asked by a real connection."""

from __future__ import annotations

from tiny import pipeline  # noqa: F401
from visitor import Visitor

from motionary.app import server
from motionary.corpus.store import Corpus
from motionary.nn.layers import seeded
from motionary.systems.action2motion.conditioned_vae import Action2Motion, Action2MotionConfig
from motionary.systems.io import save_model


def test_a_visitor_asks_for_an_action(pipeline, tmp_path):  # noqa: F811
    context = Corpus.open(pipeline / "data/corpus").context
    with seeded(0):
        model = Action2Motion(Action2MotionConfig(("sit", "walk"), width=8, latent=3, upstream=2), context)
    save_model(tmp_path / "models/action2motion/glmi_m", "action2motion", model, context)
    app = server.App(tmp_path / "models", "cpu", "127.0.0.1", 0)
    try:
        visitor = Visitor(app.url)
        visitor.until(lambda: "Act" in visitor.controls and "Then" in visitor.controls, "the tab")
        visitor.says("**sit** (3.0 s)")  # what the page opens with, once every control answers; no hand is as quick
        visitor.ask("Then", "walk")
        visitor.ask("Action", "sit")
        visitor.ask("Seconds each", 1.0)
        visitor.ask("Act")
        visitor.until(lambda: any("sit, then walk** (2.0 s)" in text for text in visitor.texts), "the motion")
        visitor.ask("Action", "fly")
        visitor.ask("Act")
        visitor.until(lambda: any("must be one of sit, walk" in said for said in visitor.notes + visitor.texts), "why")
        visitor.close()
    finally:
        app.close()
