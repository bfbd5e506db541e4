"""`--effects auto`: inspect a sequence, plan, and change the settings, in one call."""

from typing import Any

from endotsr.clips.effects.inspect import inspect_sequence, inspection_record
from endotsr.clips.effects.plan import apply_plan, make_plan, plan_record
from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config


def planned_settings(
    sequence: Sequence, config: Config, explicit: frozenset[str] = frozenset()
) -> tuple[Config, list[str], dict[str, Any]]:
    """The settings that the clip requires.

    explicit   keys given on the command line or in a file, which the plan does not change
    returns    the settings; one line for each change or kept setting with the reason; and verdicts and plan for
               `effects` in run.json
    """
    inspection = inspect_sequence(sequence)
    plan = make_plan(inspection, config, explicit)
    settings, lines = apply_plan(plan, config)
    head = "effects: auto" if lines else "effects: auto; the clip calls for everything that the settings have"
    record = inspection_record(inspection) | {"plan": plan_record(plan)}
    return settings, [head, *(f"  {line}" for line in lines)], record
