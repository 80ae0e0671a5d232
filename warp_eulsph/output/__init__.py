"""What a run leaves on disk and says about itself; the only room that knows HDF5."""

from ..options import explain_mistakes
from .directory import BusyError, RunDirectory
from .fields import DEFAULT_FIELDS, FIELDS, TRANSPORT_FIELDS
from .probes import BodyProbe, InteractionProbe, PointProbe, Probe, ReactionProbe, RigidProbe, SectionProbe
from .reader import Comparison, Run, RunFrame, points_on_line
from .record import ChangedCaseError, Outcome, record
from .recording import Recording
from .recover import Findings, check, recover
from .sealed import DamagedError
from .series import SnapshotWriter
from .snapshot import Snapshot, read_snapshot, write_snapshot
from .stopping import Stop

__all__ = [
    "DEFAULT_FIELDS",
    "FIELDS",
    "TRANSPORT_FIELDS",
    "BodyProbe",
    "BusyError",
    "ChangedCaseError",
    "Comparison",
    "DamagedError",
    "Findings",
    "InteractionProbe",
    "Outcome",
    "PointProbe",
    "Probe",
    "ReactionProbe",
    "Recording",
    "RigidProbe",
    "Run",
    "RunDirectory",
    "RunFrame",
    "SectionProbe",
    "Snapshot",
    "SnapshotWriter",
    "Stop",
    "check",
    "points_on_line",
    "read_snapshot",
    "record",
    "recover",
    "write_snapshot",
]

explain_mistakes(__all__, globals())
