"""What is in a log: topics, schemas, counts and what can serve as a position source."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .mcap_container import McapFile
from .sources import Source, list_sources


@dataclass(frozen=True)
class LogInfo:
    """Contents of a log.

    Parameters
    ----------
    file : str
    size : int
        Bytes.
    profile, library : str
        What the recorder says of itself.
    messages : int
    sources : list of Source
        Every topic; the usable ones first, in the order in which replay prefers them.
    metadata : mapping of record name to mapping
    warnings : list of str
        What is wrong with the file.
    format : str
        Kind of file.
    """

    file: str
    size: int
    profile: str
    library: str
    messages: int
    sources: list[Source]
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    format: str = 'MCAP'

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; the topics under `topics`."""
        return {
            'file': self.file,
            'format': self.format,
            'size': self.size,
            'profile': self.profile,
            'library': self.library,
            'messages': self.messages,
            'topics': [source.to_dict() for source in self.sources],
            'metadata': self.metadata,
            'warnings': self.warnings,
        }


def log_info(path: str | Path) -> LogInfo:
    """Return what is in a log; of message contents only the senders of MAVLink are read.

    Raises
    ------
    LogError
        If the file cannot be read.
    """
    with McapFile(path) as log:
        return LogInfo(
            file=str(log.path),
            size=log.size,
            profile=log.profile,
            library=log.library,
            messages=sum(log.message_counts.values()),
            sources=list_sources(log),
            metadata=dict(log.metadata),
            warnings=list(log.warnings),
        )
