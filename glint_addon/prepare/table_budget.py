"""Tables that fit the memory: where they do not, coarser counts first, then no index, then no table for the largest."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from .map_plans import MapPlan
from .memory import MIB, mebibytes


def fit_budget(plans: Collection[MapPlan], budget: float) -> list[str]:
    """Change the `MapPlan`s so that all tables together take at most `budget` MiB of memory; sentences that say so.

    A map without table renders through Blender's own nodes, right and noisy; without its finest counts it renders right
    too, and with more noise where its texels are small.
    """
    # Leave out the largest maps until the tables of normals of the others fit.
    warnings = []
    needed = _bytes(plans)
    left_out = []
    kept = sorted(plans, key=lambda plan: (plan.table_bytes, plan.image.name_full))
    while kept and sum(plan.table_bytes for plan in kept) > budget * MIB:
        plan = kept.pop()
        plan.has_table, plan.has_index, plan.levels = False, False, None
        left_out.append(plan)

    # Drop the finest blocks of the map whose counts are largest, then indices, until the rest fits.
    coarser = []
    while _bytes(kept) > budget * MIB:
        plan = max(kept, key=lambda plan: (plan.counts_bytes, plan.index_bytes))
        if plan.levels is None:
            plan.has_index = False
        else:
            first, last = plan.levels
            plan.levels = (2 * first, last) if first < last else None
        coarser.append(plan)

    reason = f"glint tables take {mebibytes(needed)} of memory and the budget is {mebibytes(budget * MIB)}"
    cure = "raise Table Budget or use smaller maps"
    if left_out:
        warnings.append(f"{_names(left_out)} left to Blender's own nodes, which are noisy ({reason}): {cure}.")
    if coarser:
        warnings.append(f"{_names(coarser)} noisier or slower in far views, with fewer tables ({reason}): {cure}.")
    return warnings


def _bytes(plans: Iterable[MapPlan]) -> int:
    """Memory of all tables of the plans."""
    return sum(plan.table_bytes + plan.counts_bytes + plan.index_bytes for plan in plans)


def _names(plans: Iterable[MapPlan]) -> str:
    """ 'The normal map "a" is' or 'The normal maps "a", "b" are'."""
    names = sorted({f'"{plan.image.name}"' for plan in plans})
    return f"The normal map {names[0]} is" if len(names) == 1 else f"The normal maps {', '.join(names)} are"
