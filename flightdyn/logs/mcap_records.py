"""The records of the MCAP container: opcodes, layouts and reading fields without overrunning."""

import mmap
import struct
from collections.abc import Iterable

import numpy as np

MAGIC = b'\x89MCAP0\r\n'

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, METADATA, METADATA_INDEX, DATA_END = 0x0B, 0x0C, 0x0D, 0x0F

RECORD = struct.Struct('<BQ')
FOOTER_RECORD = struct.Struct('<BQQQI')
MESSAGE_HEAD = np.dtype(
    [
        ('opcode', 'u1'),
        ('length', '<u8'),
        ('channel', '<u2'),
        ('sequence', '<u4'),
        ('log_time', '<i8'),
        ('publish_time', '<i8'),
    ]
)
MESSAGE_INDEX_HEAD = np.dtype(
    [('opcode', 'u1'), ('length', '<u8'), ('channel', '<u2'), ('size', '<u4')]
)
INDEX_ENTRY = np.dtype([('log_time', '<i8'), ('offset', '<u8')])

OTHER_FORMATS = {
    b'#ROSBAG V': "a ROS 1 bag; convert it with 'mcap convert'",
    b'SQLite format 3': "a ROS 2 bag of the sqlite3 kind; convert it with 'ros2 bag convert'",
    b'ULog\x01\x12\x35': 'a PX4 ULog',
    b'RRF': 'a Rerun recording',
    b'\xa3\x95': 'an ArduPilot dataflash log',
    b'PK\x03\x04': 'a zip archive',
    b'\x28\xb5\x2f\xfd': 'a zstd file; unpack it first',
    b'\x1f\x8b': 'a gzip file; unpack it first',
}


class DamageError(Exception):
    """Something does not fit at a byte; becomes a warning (file cut short) or a LogError."""

    def __init__(self, offset: int, text: str) -> None:
        super().__init__(f'byte {offset}: {text}')
        self.offset = offset


class RecordReader:
    """Fields of one record, one after the other; never past its end."""

    def __init__(self, data: memoryview | mmap.mmap, at: int, end: int) -> None:
        self.data, self.at, self.end = data, at, end

    def skip(self, size: int) -> int:
        """Return where the next `size` bytes begin and go past them."""
        at = self.at
        if size > self.end - at:
            raise DamageError(at, f'a record ends {size - (self.end - at)} bytes too early')
        self.at = at + size
        return at

    def u16(self) -> int:
        return int(struct.unpack_from('<H', self.data, self.skip(2))[0])

    def u32(self) -> int:
        return int(struct.unpack_from('<I', self.data, self.skip(4))[0])

    def u64(self) -> int:
        return int(struct.unpack_from('<Q', self.data, self.skip(8))[0])

    def blob(self) -> bytes:
        size = self.u32()
        at = self.skip(size)
        return bytes(self.data[at : at + size])

    def text(self) -> str:
        return self.blob().decode('utf-8', 'replace')

    def text_map(self) -> dict[str, str]:
        end = self.u32() + self.at
        if end > self.end:
            raise DamageError(self.at, 'a map is longer than its record')
        values: dict[str, str] = {}
        while self.at < end:
            key = self.text()
            values[key] = self.text()
        return values

    def pairs(self, layout: str) -> Iterable[tuple[int, int]]:
        size = self.u32()
        at = self.skip(size)
        if size % struct.calcsize(layout):
            raise DamageError(at, f'a list of {size} bytes does not hold whole entries')
        return struct.iter_unpack(layout, self.data[at : at + size])
