"""The table of the kinds of analysis, by the names that case files and results folders have for them."""

from __future__ import annotations

from .kind import AnalysisKind
from .limit_load import LimitLoadKind
from .pushover import PushoverKind
from .settlement import SettlementKind

#: The first is that of a case file that names none.
KINDS: dict[str, AnalysisKind] = {kind.name: kind for kind in (SettlementKind(), LimitLoadKind(), PushoverKind())}
