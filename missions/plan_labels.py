"""Labels of a plan, placed when the plan is drawn, so that no two texts overlap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray

PLACES = {
    "below": (0.0, -1.0),
    "above": (0.0, 1.0),
    "right": (1.0, 0.0),
    "left": (-1.0, 0.0),
    "above right": (1.0, 1.0),
    "below right": (1.0, -1.0),
    "above left": (-1.0, 1.0),
    "below left": (-1.0, -1.0),
    "centre": (0.0, 0.0),
}
"""Directions from an object to its label."""

GAP_PT = 2.5
"""Distance of a label from its object, so that a mark there does not cover it, and least distance of two texts."""


class PlanLabel(NamedTuple):
    """Label of an object on a plan.

    Attributes:
        text: The text with its style.
        low_m: South-west corner of the object.
        high_m: North-east corner of the object.
        places: Keys of `PLACES`, the best first.
        rank: Labels of lower rank are placed first.
        margin_pt: Distance that the object's marker extends beyond the corners.
    """

    text: Text
    low_m: FloatArray
    high_m: FloatArray
    places: Sequence[str]
    rank: float = 0.0
    margin_pt: float = 0.0


class PlanLabels(Artist):
    """All labels of a plan. Each is drawn at the first of its places that is free of texts, or else left out.

    Other texts of the axes are drawn as they are, and labels keep off them. Places that cover no object are preferred.
    """

    def __init__(self, axes: Axes) -> None:
        super().__init__()
        self._plan = axes
        self._labels = list[PlanLabel]()
        self.set_zorder(9)
        self.set_in_layout(False)
        axes.add_artist(self)

    def add(
        self,
        text: str,
        corners_m: tuple[ArrayLike, ArrayLike],
        places: Sequence[str],
        rank: float = 0.0,
        margin_pt: float = 0.0,
        **style: Any,  # noqa: ANN401 - properties of a text
    ) -> None:
        """Add a label.

        Args:
            text: The label.
            corners_m: South-west and north-east corner of the labelled object, world frame.
            places: Keys of `PLACES`, the best first.
            rank: Labels of lower rank are placed first.
            margin_pt: Distance that the object's marker extends beyond the corners.
            style: Properties of the text.
        """
        outline = [withStroke(linewidth=2.2, foreground="white")]
        made = Text(0.0, 0.0, text, ha="center", va="center", **{"path_effects": outline, "parse_math": False, **style})
        made.set_figure(self._plan.figure)
        low_m, high_m = np.array(corners_m, dtype=np.float64)
        self._labels.append(PlanLabel(made, low_m, high_m, places, rank, margin_pt))

    def get_children(self) -> list[Artist]:
        """Return the texts."""
        return [label.text for label in self._labels]

    def draw(self, renderer: RendererBase) -> None:
        """Place and draw the labels."""
        gap_px = renderer.points_to_pixels(GAP_PT)
        taken = [
            text.get_window_extent(renderer).padded(gap_px)
            for text in self._plan.texts
            if text.get_visible() and text.get_text()
        ]
        labels = sorted(self._labels, key=lambda label: label.rank)
        to_px = self._plan.transData.transform
        objects_px = np.array([[to_px(label.low_m), to_px(label.high_m)] for label in labels]).reshape(-1, 2, 2)
        margin_px = np.array([renderer.points_to_pixels(label.margin_pt) for label in labels])
        objects_px += margin_px[:, np.newaxis, np.newaxis] * np.array([[-1.0], [1.0]])
        for label, (low_px, high_px) in zip(labels, objects_px, strict=True):
            size_px = np.array(label.text.get_window_extent(renderer).size)
            boxes = [_box(low_px - gap_px, high_px + gap_px, size_px, place) for place in label.places]
            inside = [box for box in boxes if _holds(self._plan.bbox, box)]
            free = [box for box in inside if box.count_overlaps(taken) == 0]
            free.sort(key=lambda box: _covers(box, objects_px))  # stable: the better place comes first
            label.text.set_visible(bool(free))
            if free:
                taken.append(free[0].padded(gap_px))
                label.text.set_position(tuple(0.5 * (free[0].min + free[0].max)))
                label.text.draw(renderer)
        self.stale = False


def labels_of(axes: Axes) -> PlanLabels:
    """Return the labels of the plan that is drawn on axes."""
    return next((artist for artist in axes.artists if isinstance(artist, PlanLabels)), None) or PlanLabels(axes)


def _box(low_px: FloatArray, high_px: FloatArray, size_px: FloatArray, place: str) -> Bbox:
    """Return the box of a text of a size at a place of an object."""
    reach_px = 0.5 * (high_px - low_px + size_px)
    centre_px = 0.5 * (low_px + high_px) + np.array(PLACES[place]) * reach_px
    return Bbox([centre_px - 0.5 * size_px, centre_px + 0.5 * size_px])


def _holds(outer: Bbox, inner: Bbox) -> bool:
    """Return whether a box lies within another."""
    return bool((inner.min >= outer.min).all() and (inner.max <= outer.max).all())


def _covers(box: Bbox, objects_px: FloatArray) -> bool:
    """Return whether a text covers any object, given as corners of shape (n, 2, 2)."""
    return bool(((objects_px[:, 0] < box.max) & (objects_px[:, 1] > box.min)).all(axis=-1).any())
