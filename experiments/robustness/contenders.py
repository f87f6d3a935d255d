"""What is compared: a law, alone or with an inverse model beside it, with a nominal or a calibrated robot."""

from dataclasses import dataclass

from experiments.comparison.compare import named_laws
from experiments.report.style import law_title
from robots.configuration.suggestion import did_you_mean
from systems.feedforward import FEEDFORWARDS

CALIBRATED = "@calibrated"


@dataclass(frozen=True)
class Contender:
    """A law and what it is given; the text is what stands in ``--laws`` and in the JSON."""

    text: str
    law: str
    feedforward: str | None = None
    is_calibrated: bool = False

    @property
    def title(self) -> str:
        """For people."""
        beside = f" with {self.feedforward.replace('_', ' ')}" if self.feedforward else ""
        return law_title(self.law) + beside + (", calibrated robot" if self.is_calibrated else "")

    @property
    def settings(self) -> tuple[str, ...]:
        """Of the scenario, as ``--set`` takes them."""
        return (f"servo.feedforward.kind={self.feedforward}",) if self.feedforward else ()


def contenders(text: str) -> list[Contender]:
    """Reads ``LAW[+FEEDFORWARD][@calibrated],...``.

    Raises:
        ValueError: if a law or an inverse model is unknown, or something stands there twice.
    """
    found: list[Contender] = []
    for part in (part.strip() for part in text.split(",")):
        law, is_calibrated = part.removesuffix(CALIBRATED), part.endswith(CALIBRATED)
        law, plus, feedforward = law.rpartition("+") if "+" in law else (law, "", "")
        if plus and feedforward not in FEEDFORWARDS:
            guess = did_you_mean(feedforward, FEEDFORWARDS)
            raise ValueError(
                f"--laws: '{part}': behind + stands one of {', '.join(FEEDFORWARDS)}, "
                f"got '{feedforward}'{guess}"
            )
        named_laws(law)
        contender = Contender(part, law, feedforward or None, is_calibrated)
        if contender in found:
            raise ValueError(f"--laws: '{part}' is there twice")
        found.append(contender)
    return found
