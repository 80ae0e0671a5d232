"""What a run leaves on disk and says about itself; the only room that knows HDF5."""

from .checkpoint import DamagedError
from .directory import BusyError, RunDirectory
from .probes import BodyProbe, PointProbe, Probe, ReactionProbe, SectionProbe
from .record import ChangedCaseError, Outcome, record
from .recording import Recording
from .report import Figure, table
from .series import SnapshotWriter
from .snapshot import FIELDS, Snapshot, read_snapshot, write_snapshot
from .stopping import Stop

__all__ = [
    "FIELDS",
    "BodyProbe",
    "BusyError",
    "ChangedCaseError",
    "DamagedError",
    "Figure",
    "Outcome",
    "PointProbe",
    "Probe",
    "ReactionProbe",
    "Recording",
    "RunDirectory",
    "SectionProbe",
    "Snapshot",
    "SnapshotWriter",
    "Stop",
    "read_snapshot",
    "record",
    "table",
    "write_snapshot",
]
