"""What a file says that `etendue convert` has written for Mitsuba 3."""

import xml.etree.ElementTree as ElementTree


def integrator_of(scene):
    """`path`, or `volpath` where Mitsuba's path would ignore media or count masks as vertices."""
    integrator = ElementTree.parse(scene).getroot().find("integrator")
    return "path" if integrator is None else integrator.get("type")
