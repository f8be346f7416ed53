"""Does a machine without load stay where it is commanded?"""

from __future__ import annotations

from stiffmap.model.description.elements import Cable, Element, Joint, Offset, Spring
from stiffmap.model.description.machine import MachineDescription
from stiffmap.model.description.tree import all_elements


def rests_at_command(description: MachineDescription) -> bool:
    """True where nothing but wrenches and gravity can deflect the machine: no geometric or command
    error, no preload, no passive joint with a spring, no external spring."""
    return not description.external_springs and not any(_strains(e) for _, e in all_elements(description))


def _strains(e: Element) -> bool:
    match e:
        case Offset():
            return e.actual is not None and e.actual != e.nominal
        case Cable():
            return True  # gravity or pretension may stretch it differently from what its controller believes
        case Joint():
            sprung = not e.actuated and any(e.laws)  # away from home
            return bool(e.command_errors or e.guide_errors or sprung)
        case Spring():
            return any(e.rest)
    return False
