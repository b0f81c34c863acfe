"""Flight logs: what is in them, the track of a source, and recordings of our own."""

from .any_log import read_track as read_track
from .info import LogInfo as LogInfo
from .info import log_info as log_info
from .mcap_container import McapFile as McapFile
from .sources import Source as Source
from .sources import list_sources as list_sources
from .track import Track as Track
