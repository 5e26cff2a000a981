"""Every system, declared once: where its code lies, what it stands on, and what it offers.

The rest of the project finds systems here: stages ask for what a system `needs`; the dictionary, the shell, the page,
evaluation and report look `offers` up. Nothing is imported before it is used. A package outside this one adds a system
by an entry point of the group ``motionary.systems`` that names a :class:`System`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from motionary.errors import InputError

ENTRY_POINTS = "motionary.systems"

# What a system may offer; each is a protocol of motionary.systems.protocols (of actions: action_protocols).
CODEC = "codec"  # MotionCodec
TEXT_TO_MOTION = "text_to_motion"  # TextToMotion
MOTION_TO_TEXT = "motion_to_text"  # MotionToText
TEXT_TO_LENGTH = "text_to_length"  # TextToLength
STYLIZE = "stylize"  # MotionStylizer
EMBED = "embed"  # TextMotionJudge
JUDGE_STYLE = "judge_style"  # StyleClassifier
SEARCH = "search"  # CorpusSearch
ACT = "act"  # ActionToMotion
JUDGE_ACTION = "judge_action"  # ActionClassifier
BLEND = "blend"  # TextBlender
INFILL = "infill"  # MotionInfiller of control_protocols
TELLS = {
    CODEC: "turn motion into codes and back",
    TEXT_TO_MOTION: "turn text into motion",
    MOTION_TO_TEXT: "turn motion into text",
    TEXT_TO_LENGTH: "tell lengths from text",
    STYLIZE: "stylize motion",
    EMBED: "embed texts and motions",
    JUDGE_STYLE: "tell style and action",
    SEARCH: "search the corpus",
    ACT: "make motions of action labels",
    JUDGE_ACTION: "tell actions apart",
    BLEND: "go from one text to another",
    INFILL: "complete motions",
}


@dataclass(frozen=True)
class System:
    """One system.

    Attributes:
        name: of the system, its stage, its section of the configuration and its folder under ``models/``.
        family: the folder below ``motionary/systems`` that holds it.
        model: "module.Class" of its network within the family; "" where it has none of its own.
        config: "module.Class" of the dataclass that the network is built from.
        needs: the systems that it is trained on, by role; the role's name is also the usual system in it.
        serves_with: the systems that what it offers asks for.
        offers: name of the function in the family's ``system.py`` that opens each thing it offers, by that thing.
        build: name of the function there that makes a fresh model: (settings, context, :class:`io.Trained`).
        package: full name of the family's package; empty for the families of this project.
        about: what it does, in one sentence for whoever uses it.
    """

    name: str
    family: str
    model: str = ""
    config: str = ""
    needs: tuple[str, ...] = ()
    serves_with: tuple[str, ...] = ()
    offers: Mapping[str, str] = field(default_factory=dict)
    build: str = ""
    package: str = ""
    about: str = field(default="", repr=False)  # no part of what stages hash

    @property
    def module(self) -> str:
        """Full name of the package that holds the code."""
        return self.package or f"motionary.systems.{self.family}"

    def load(self, place: str) -> Any:
        """What stands at "module.Name" in the family's package."""
        module, name = place.rsplit(".", 1)
        return getattr(import_module(f"{self.module}.{module}"), name)

    def function(self, name: str) -> Callable[..., Any]:
        """A function of the family's ``system.py``."""
        return self.load(f"system.{name}")


SYSTEMS: tuple[System, ...] = (
    # TM2T
    System(
        "tokenizer", "tm2t", "tokenizer.Tokenizer", "tokenizer.TokenizerConfig",
        offers={CODEC: "open_codec"}, build="build_tokenizer",
        about="Turns motion into discrete tokens and back (TM2T).",
    ),
    System(
        "motion2text", "tm2t", "motion2text.Motion2Text", "motion2text.Motion2TextConfig", ("tokenizer",),
        ("tokenizer",), {MOTION_TO_TEXT: "open_captioner"}, "build_motion2text",
        about="Translates motion tokens into a sentence, word by word (TM2T).",
    ),
    System(
        "text2token", "tm2t", "text2token.Text2Token", "text2token.Text2TokenConfig", ("tokenizer",),
        ("tokenizer",), {TEXT_TO_MOTION: "open_token_generator"}, "build_text2token",
        about="Translates a sentence into motion tokens, one after another (TM2T's baseline).",
    ),
    System(
        "inverse_alignment", "tm2t", "inverse_alignment.InverseAlignment", "inverse_alignment.InverseAlignmentConfig",
        ("text2token", "motion2text", "tokenizer"),
        ("tokenizer",), {TEXT_TO_MOTION: "open_token_generator"}, "build_inverse_alignment",
        about="Translates a sentence into motion tokens that a captioner can read back (TM2T).",
    ),
    # T2M, thesis chapter 4
    System(
        "autoencoder", "t2m", "autoencoder.Autoencoder", "autoencoder.AutoencoderConfig",
        offers={CODEC: "open_codec"}, build="build_autoencoder",
        about="Turns motion into snippet codes and back (T2M).",
    ),
    System(
        "text2length", "t2m", "text2length.Text2Length", "text2length.Text2LengthConfig",
        offers={TEXT_TO_LENGTH: "open_lengths"}, build="build_text2length",
        about="Tells how long a motion lasts that a sentence describes (T2M).",
    ),
    System(
        "text2motion", "t2m", "text2motion.Text2Motion", "text2motion.Text2MotionConfig", ("autoencoder",),
        ("text2length",), {CODEC: "open_codec", TEXT_TO_MOTION: "open_motion_generator"}, "build_text2motion",
        about="Draws motion snippet by snippet, of a length that it tells from the sentence (T2M).",
    ),
    System(
        "temos", "temos", "temos.Temos", "temos.TemosConfig", (), ("text2length",),
        {
            TEXT_TO_MOTION: "open_generator", BLEND: "open_generator", EMBED: "open_joint_space",
            SEARCH: "open_joint_search",
        }, "build_temos",
        about="Draws a whole motion at once, from a space that it shares with sentences (TEMOS).",
    ),
    # Residual tokens and masked generation, after MoMask
    System(
        "residual_tokenizer", "masked", "residual_tokenizer.ResidualTokenizer",
        "residual_tokenizer.ResidualTokenizerConfig", offers={CODEC: "open_codec"}, build="build_residual_tokenizer",
        about="Turns motion into layers of tokens and back, each layer what the last one missed (MoMask).",
    ),
    System(
        "masked_generator", "masked", "masked_generator.MaskedGenerator", "masked_generator.MaskedGeneratorConfig",
        ("residual_tokenizer",), ("residual_tokenizer", "text2length"),
        {TEXT_TO_MOTION: "open_motion_filler", INFILL: "open_motion_filler"}, "build_masked_generator",
        about="Fills in motion tokens in any order, so that parts of a motion can be made anew (MoMask).",
    ),
    System(
        "masked_autoregression", "masked", "masked_autoregression.MaskedAutoregression",
        "masked_autoregression.MaskedAutoregressionConfig", ("autoencoder",), ("text2length",),
        {CODEC: "open_components", TEXT_TO_MOTION: "open_snippet_generator", INFILL: "open_snippet_generator"},
        "build_masked_autoregression",
        about="Fills in snippet codes in any order, each drawn by a flow from noise (MAR).",
    ),
    # Latent stylization, thesis chapter 5
    System(
        "latents", "stylization", "latents.Latents", "latents.LatentsConfig", build="build_latents",
        about="Turns motion into a code for four frames, in which styles are changed.",
    ),
    System(
        "global_motion", "stylization", "global_motion.GlobalMotion", "global_motion.GlobalMotionConfig",
        build="build_global_motion",
        about="Tells from a pose's movement how the body travels.",
    ),
    System(
        "stylization", "stylization", "stylizer.Stylizer", "stylizer.StylizationConfig", ("latents",),
        ("global_motion",), {STYLIZE: "open_stylizer"}, "build_stylizer",
        about="Gives a motion another style and keeps what it does (latent stylization).",
    ),
    # action2motion, thesis chapter 3
    System(
        "action2motion", "action2motion", "conditioned_vae.Action2Motion", "conditioned_vae.Action2MotionConfig",
        offers={ACT: "open_actor"}, build="build_action2motion",
        about="Draws motion of an action's name, frame by frame (action2motion).",
    ),
    # What scores the others
    System(
        "evaluator", "judges", "evaluator.Evaluator", "evaluator.EvaluatorConfig", ("autoencoder",),
        offers={EMBED: "open_judge"}, build="build_evaluator",
        about="Judges whether a motion fits a sentence.",
    ),
    System(
        "joint_evaluator", "judges", "joint_evaluator.JointEvaluator", "joint_evaluator.JointEvaluatorConfig",
        offers={EMBED: "open_judge"}, build="build_joint_evaluator",
        about="Judges whether a motion fits a sentence, from joints alone: the second opinion.",
    ),
    System(
        "style_evaluator", "judges", "style_evaluator.StyleEvaluator", "style_evaluator.StyleEvaluatorConfig",
        offers={JUDGE_STYLE: "open_style_judge"}, build="build_style_evaluator",
        about="Tells the style and the action of a motion.",
    ),
    System(
        "action_evaluator", "judges", "action_evaluator.ActionEvaluator", "action_evaluator.ActionEvaluatorConfig",
        offers={JUDGE_ACTION: "open_action_judge"}, build="build_action_evaluator",
        about="Tells the action of a motion.",
    ),
    System(
        "retrieval", "judges", needs=("evaluator",), serves_with=("evaluator",),
        offers={TEXT_TO_MOTION: "open_retrieval", MOTION_TO_TEXT: "open_retrieval", SEARCH: "open_retrieval"},
        about="Copies the nearest motion or caption of the training data: the baseline that makes nothing.",
    ),
)  # fmt: skip

# Which system answers where several offer the same, the call names none and no report says which is best.
PREFERRED = {TEXT_TO_MOTION: "text2motion", MOTION_TO_TEXT: "motion2text", EMBED: "evaluator", SEARCH: "retrieval"}


@cache
def known() -> dict[str, System]:
    """Every system by name: the project's own, then those of installed packages. A name taken twice is an error."""
    found = {system.name: system for system in SYSTEMS}
    for point in entry_points(group=ENTRY_POINTS):
        try:
            system = point.load()
        except (ImportError, AttributeError) as error:
            raise InputError(f"entry point {point.name}", point.value, f"cannot be loaded: {error}") from None
        if not isinstance(system, System):
            raise InputError(f"entry point {point.name}", point.value, "must name a motionary.systems.registry.System")
        if system.name in found:
            raise InputError(f"entry point {point.name}", system.name, "a system of this name is there already")
        found[system.name] = system
    return found


def find(name: str) -> System:
    """The system of that name; InputError lists the known ones."""
    systems = known()
    if name not in systems:
        raise InputError("system", name, f"must be one of {', '.join(systems)}")
    return systems[name]


def offering(offer: str, among: Iterable[str] | None = None) -> tuple[str, ...]:
    """Names of the systems (of `among`, where given) that offer something: the preferred one, then as declared."""
    wanted = known() if among is None else set(among)
    found = [name for name, system in known().items() if name in wanted and offer in system.offers]
    return tuple(sorted(found, key=lambda name: name != PREFERRED.get(offer)))


def judges() -> tuple[str, ...]:
    """Names of the systems that judge the others: those that embed and make no motions, which they would judge in
    their own space."""
    return tuple(name for name in offering(EMBED) if TEXT_TO_MOTION not in find(name).offers)
