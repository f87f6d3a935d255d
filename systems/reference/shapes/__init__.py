"""Shapes of paths: a class for each, one line here."""

from systems.reference.shapes.circle import Circle
from systems.reference.shapes.figure_eight import FigureEight
from systems.reference.shapes.planned import Planned
from systems.reference.shapes.points import Points, Rectangle, Waypoint, rectangle_waypoints

# What `reference.path` may be; without a tag it is the first one. A shape has fields, a `kind`, the pieces of
# which the path is made, the length of the parameter on each, and whether the tool rests between them; a
# planned path has its motion instead.
Shape = Rectangle | Circle | FigureEight | Points | Planned

__all__ = [
    "Circle",
    "FigureEight",
    "Planned",
    "Points",
    "Rectangle",
    "Shape",
    "Waypoint",
    "rectangle_waypoints",
]
