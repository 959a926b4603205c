"""The section on π_R2S2R on every cable."""

from robotcast.reporting.page import Section
from robotcast.reporting.results import Results
from robotcast.reporting.sections.endpoints import targets_of
from robotcast.reporting.tables.cables import cables_table


def cables_section(results: Results) -> Section:
    """Show the policy of the mixed data on every cable."""
    mixed = [e for e in results.evaluations if (e.policy, e.dataset) == ("nn", "mixed")]
    mixed = [e for e in mixed if e.kind == "executed" and len(e.casts)]
    figures = (targets_of(results, mixed, "targets", "π_R2S2R on every cable"),) if mixed else ()
    return Section("Does it hold for every cable?", "", cables_table(results), figures)
