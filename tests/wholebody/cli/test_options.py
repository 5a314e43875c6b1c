"""Strategy: a made-up command with a group is called as typer calls it; groups of ours hold every default."""

from dataclasses import dataclass
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from wholebody.cli.commands.serve_policy import ServingOptions
from wholebody.cli.grouped import OptionsByGroup
from wholebody.cli.options import flat


@dataclass(frozen=True)
class Paint:
    """What it is painted with."""

    color: Annotated[str, typer.Option(help="What it looks like.")] = "red"
    coats: Annotated[int, typer.Option("--layers", help="How thick it is.")] = 2


def app(command):
    made = typer.Typer(rich_markup_mode=None)
    made.command(cls=OptionsByGroup)(flat(command))
    return made


def paint(*, thing: Annotated[str, typer.Argument()], paint: Paint, dry: bool = False) -> None:
    """Paint a thing."""
    print(thing, paint, dry)


def test_the_fields_of_a_group_are_options_with_their_names_defaults_and_help():
    text = CliRunner().invoke(app(paint), ["--help"]).output
    assert "Paint a thing." in text
    assert text.index("--color") < text.index("--layers") < text.index("--dry")
    assert "What it looks like.  [default: red]" in text
    assert text.index("Arguments:") < text.index("What it is painted with:") < text.index("--color")
    assert text.index("--layers") < text.index("Options:") < text.index("--dry")


def test_a_command_gets_its_groups_made_of_what_was_typed():
    typed = CliRunner().invoke(app(paint), ["door", "--layers", "3", "--dry"])
    assert typed.output == "door Paint(color='red', coats=3) True\n"
    assert CliRunner().invoke(app(paint), ["door"]).output == "door Paint(color='red', coats=2) False\n"


def test_two_groups_with_one_option_are_refused():
    def twice(*, one: Paint, two: Paint) -> None: ...

    with pytest.raises(ValueError, match="duplicate parameter name: 'color'"):
        flat(twice)


def test_a_seed_of_zero_is_passed_on_and_what_is_empty_is_not_chosen():
    chosen = ServingOptions(seed=0, num_steps=0, device="").choices()
    assert (chosen["seed"], chosen["num_steps"], chosen["device"]) == (0, None, None)
