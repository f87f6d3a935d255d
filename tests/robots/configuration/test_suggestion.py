"""What somebody probably meant."""

import pytest

from robots.configuration.suggestion import did_you_mean


@pytest.mark.parametrize(
    ("given", "known", "said"),
    [
        ("plcement", ["placement", "limits"], "; did you mean placement?"),
        ("PBVS", ["pbvs", "open_loop"], "; did you mean pbvs?"),
        ("--lawz", ["--laws", "--set"], "; did you mean --laws?"),
        ("egn", ["simulated", "egm", "rsi"], "; did you mean egm?"),
        ("kr201", ["kr210", "kr16"], "; did you mean kr210?"),
        ("station", ["duration", "json"], ""),
        ("", ["a", ""], ""),
    ],
)
def test_a_guess_is_made_where_a_name_is_alike(given: str, known: list[str], said: str):
    assert did_you_mean(given, known) == said
