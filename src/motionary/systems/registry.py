"""Every system, declared once: where its code lies, what it stands on, and what it offers.

The rest of the project finds systems here: stages ask for what a system `needs`; the dictionary, the shell, the page,
evaluation and report look `offers` up. Nothing is imported before it is used. A package outside this one adds a system
by an entry point of the group ``motionary.systems`` that names a :class:`System`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
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
    ),
    System(
        "motion2text", "tm2t", "motion2text.Motion2Text", "motion2text.Motion2TextConfig", ("tokenizer",),
        ("tokenizer",), {MOTION_TO_TEXT: "open_captioner"}, "build_motion2text",
    ),
    System(
        "text2token", "tm2t", "text2token.Text2Token", "text2token.Text2TokenConfig", ("tokenizer",),
        ("tokenizer",), {TEXT_TO_MOTION: "open_token_generator"}, "build_text2token",
    ),
    System(
        "inverse_alignment", "tm2t", "inverse_alignment.InverseAlignment", "inverse_alignment.InverseAlignmentConfig",
        ("text2token", "motion2text", "tokenizer"),
        ("tokenizer",), {TEXT_TO_MOTION: "open_token_generator"}, "build_inverse_alignment",
    ),
    # T2M, thesis chapter 4
    System(
        "autoencoder", "t2m", "autoencoder.Autoencoder", "autoencoder.AutoencoderConfig",
        offers={CODEC: "open_codec"}, build="build_autoencoder",
    ),
    System(
        "text2length", "t2m", "text2length.Text2Length", "text2length.Text2LengthConfig",
        offers={TEXT_TO_LENGTH: "open_lengths"}, build="build_text2length",
    ),
    System(
        "text2motion", "t2m", "text2motion.Text2Motion", "text2motion.Text2MotionConfig", ("autoencoder",),
        ("text2length",), {CODEC: "open_codec", TEXT_TO_MOTION: "open_motion_generator"}, "build_text2motion",
    ),
    System(
        "temos", "temos", "temos.Temos", "temos.TemosConfig", (), ("text2length",),
        {
            TEXT_TO_MOTION: "open_generator", BLEND: "open_generator", EMBED: "open_joint_space",
            SEARCH: "open_joint_search",
        }, "build_temos",
    ),
    # Residual tokens and masked generation, after MoMask
    System(
        "residual_tokenizer", "masked", "residual_tokenizer.ResidualTokenizer",
        "residual_tokenizer.ResidualTokenizerConfig", offers={CODEC: "open_codec"}, build="build_residual_tokenizer",
    ),
    System(
        "masked_generator", "masked", "masked_generator.MaskedGenerator", "masked_generator.MaskedGeneratorConfig",
        ("residual_tokenizer",), ("residual_tokenizer", "text2length"),
        {TEXT_TO_MOTION: "open_motion_filler", INFILL: "open_motion_filler"}, "build_masked_generator",
    ),
    # Latent stylization, thesis chapter 5
    System("latents", "stylization", "latents.Latents", "latents.LatentsConfig", build="build_latents"),
    System(
        "global_motion", "stylization", "global_motion.GlobalMotion", "global_motion.GlobalMotionConfig",
        build="build_global_motion",
    ),
    System(
        "stylization", "stylization", "stylizer.Stylizer", "stylizer.StylizationConfig", ("latents",),
        ("global_motion",), {STYLIZE: "open_stylizer"}, "build_stylizer",
    ),
    # action2motion, thesis chapter 3
    System(
        "action2motion", "action2motion", "conditioned_vae.Action2Motion", "conditioned_vae.Action2MotionConfig",
        offers={ACT: "open_actor"}, build="build_action2motion",
    ),
    # What scores the others
    System(
        "evaluator", "judges", "evaluator.Evaluator", "evaluator.EvaluatorConfig", ("autoencoder",),
        offers={EMBED: "open_judge"}, build="build_evaluator",
    ),
    System(
        "joint_evaluator", "judges", "joint_evaluator.JointEvaluator", "joint_evaluator.JointEvaluatorConfig",
        offers={EMBED: "open_judge"}, build="build_joint_evaluator",
    ),
    System(
        "style_evaluator", "judges", "style_evaluator.StyleEvaluator", "style_evaluator.StyleEvaluatorConfig",
        offers={JUDGE_STYLE: "open_style_judge"}, build="build_style_evaluator",
    ),
    System(
        "action_evaluator", "judges", "action_evaluator.ActionEvaluator", "action_evaluator.ActionEvaluatorConfig",
        offers={JUDGE_ACTION: "open_action_judge"}, build="build_action_evaluator",
    ),
    System(
        "retrieval", "judges", needs=("evaluator",), serves_with=("evaluator",),
        offers={TEXT_TO_MOTION: "open_retrieval", MOTION_TO_TEXT: "open_retrieval", SEARCH: "open_retrieval"},
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


def filled(name: str, sections: Callable[[str], Mapping[str, Any]] = lambda _: {}) -> dict[str, str]:
    """The system in each role that a system needs or asks for when it answers.

    Args:
        name: of the system.
        sections: the configuration of a system, by its name. The key that is called like a role says which system fills
            it; where the system's own has none, one that fills an earlier role may say it, as text2token's tokenizer
            is inverse alignment's; else it is the system of the role's name.
    """
    names: dict[str, str] = {}
    for role in dict.fromkeys((*find(name).needs, *find(name).serves_with)):
        told = (sections(other).get(role) for other in (name, *names.values()))
        names[role] = next(filter(None, told), role)
    return names


def served_by(names: Sequence[str], sections: Callable[[str], Mapping[str, Any]] = lambda _: {}) -> tuple[str, ...]:
    """These systems and every one that they ask for when they answer, each after those that it asks for; `sections` as
    for `filled`."""
    order: list[str] = []

    def visit(name: str) -> None:
        """Puts what a system asks for before it."""
        roles = filled(name, sections)
        for role in find(name).serves_with:
            visit(roles[role])
        if name not in order:
            order.append(name)

    for name in names:
        visit(name)
    return tuple(order)
