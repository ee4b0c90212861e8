"""Every picture of the exhibits, with what it shows: as files, and for the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

from matplotlib.figure import Figure

from pdpatrol.missions.reproduction.exhibit import Exhibit
from pdpatrol.missions.reproduction.output import other_figures, paper_figures


class Picture(NamedTuple):
    """A picture of one exhibit or of several.

    Attributes:
        name: Of its file, without the ending.
        exhibits: Keys of those that it shows; the page has it under the first, or at its end if it
            shows the method itself and no exhibit.
        draw: Makes it of them.
    """

    name: str
    exhibits: tuple[str, ...]
    draw: Callable[..., Figure]

    def of(self, exhibits: Mapping[str, Exhibit]) -> Figure:
        """The picture, of the exhibits by their names."""
        return self.draw(*(exhibits[name] for name in self.exhibits))


def pictures(seed: int) -> tuple[Picture, ...]:
    """All pictures; `seed` fixes what is drawn at random in them."""
    paper, other = paper_figures, other_figures
    return (
        Picture("tables_1_and_2_accuracy", ("table1", "table2"), paper.accuracy_over_noise),
        Picture("fig4_errors", ("fig4",), paper.errors_over_direction),
        Picture("fig5_manifold_error", ("fig5",), paper.manifold_error),
        Picture("fig7_elements", ("fig7",), paper.element_count),
        Picture("table3_field", ("table3",), paper.field_test),
        Picture("phase_and_sample_rate", ("phase_method", "sample_rate"), other.other_tables),
        Picture("bound", ("bound",), other.bound),
        Picture("ring_size", ("ring_size",), other.ring_size),
        Picture("elevation", ("elevation",), other.elevation),
        Picture("over_frequency", ("over_frequency",), other.over_frequency),
        Picture("fig1_pattern_and_manifold", (), paper.pattern_and_manifold),
        Picture("fig3_noisy_pulse", (), partial(paper.noisy_pulse, seed)),
    )
