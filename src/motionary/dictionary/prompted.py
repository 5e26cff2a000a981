"""Prompts in the words that a folder's systems know."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from motionary.corpus.encoding import listed
from motionary.dictionary.folder import Folder
from motionary.files import written_by
from motionary.language import Meanings, PromptReading, Sentence, Vocabulary, annotate, check_prompt, read
from motionary.language.meanings import FILE
from motionary.systems.registry import EMBED, MOTION_TO_TEXT, SEARCH, TEXT_TO_MOTION


class Prompts(Folder):
    """What a folder's systems read in a text."""

    def reading(self, text: str) -> PromptReading:
        """How a text is read, and how far it is from anything that the systems learned.

        Words that no training caption has are read as the known words nearest in meaning (`replaced`), or as nothing
        (`unknown`); `distance` is the cosine distance of the whole text to the nearest training caption (`nearest`),
        `line` says all that in a line where there is something to say.

        Raises:
            InputError: a text that cannot be read.
        """
        (sentence,) = annotate([check_prompt(text)])
        with self._lock:
            return self._read(sentence).measured(self._meanings())

    def read_as(self, text: str) -> str:
        """The words that the systems read in a text: normalized, typos corrected, unknown words as the known ones
        nearest in meaning, ``<unknown>`` where none is near."""
        return self._sentences(text)[0].normalized

    def _sentences(self, texts: str | Sequence[str], what: str = "text") -> list[Sentence]:
        given = [check_prompt(text, what) for text in listed(texts, str, what)]
        with self._lock:
            return [self._read(sentence).sentence for sentence in annotate(given)]

    def _read(self, sentence: Sentence) -> PromptReading:
        return read(sentence, self._vocabulary, self._meanings)

    @property
    def _vocabulary(self) -> Vocabulary:
        return self.context(self.first_of(EMBED, TEXT_TO_MOTION, MOTION_TO_TEXT)).vocabulary

    def _meanings(self) -> Meanings:
        """The meanings that the stage of the search wrote, else those of the known words alone."""
        return self._once("", "meanings", self._opened_meanings)

    def _opened_meanings(self) -> Meanings:
        for name in self.offering(SEARCH):
            folder: Path = self.models / name
            if (folder / FILE).is_file():
                with written_by(name, folder / FILE):
                    return Meanings.load(folder)
        return Meanings.of_words(self._vocabulary)
