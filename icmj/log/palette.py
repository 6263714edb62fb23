"""Colours of the replay: the hues of Okabe and Ito, for every kind of colour vision, legible on dark and white.

The viewer's plots are on the ground of its theme, dark or light; so every colour of a series is of middling lightness,
with a contrast of three to one or more to both. The body and the pictures in a frame have a dark ground of their own.
"""

from __future__ import annotations

Colour = tuple[int, int, int, int]

ORANGE: Colour = (208, 128, 0, 255)
SKY: Colour = (58, 150, 214, 255)
GREEN: Colour = (0, 158, 115, 255)
OLIVE: Colour = (150, 140, 10, 255)
BLUE: Colour = (0, 114, 178, 255)
VERMILION: Colour = (208, 66, 20, 255)
PURPLE: Colour = (200, 112, 162, 255)
BROWN: Colour = (150, 98, 60, 255)
GREY: Colour = (130, 130, 130, 255)
# on a dark ground of their own only
WHITE: Colour = (240, 240, 240, 255)
YELLOW: Colour = (240, 228, 66, 255)

CONTINUOUS = GREY
LEVEL: Colour = (176, 96, 152, 255)
EVENT = VERMILION
E = SKY
RUNNING = GREY
CRITICAL = ORANGE
OTHER_MODES: Colour = (95, 110, 120, 255)

_CYCLE = (SKY, ORANGE, GREEN, PURPLE, VERMILION, OLIVE, BLUE, BROWN)


def choose_colours(count: int) -> tuple[Colour, ...]:
    """Colours of ``count`` series; they repeat after eight."""
    return tuple(_CYCLE[i % len(_CYCLE)] for i in range(count))


def darken(colour: Colour) -> Colour:
    """The same hue, darker: a prediction under its measurement, the approach to a cycle."""
    r, g, b, a = colour
    return (r * 2 // 5 + 12, g * 2 // 5 + 12, b * 2 // 5 + 12, a)


def fade(colour: Colour) -> Colour:
    """The same hue, greyer: the acting input, drawn over the command."""
    r, g, b, a = colour
    return ((r + 130) // 2, (g + 130) // 2, (b + 130) // 2, a)
