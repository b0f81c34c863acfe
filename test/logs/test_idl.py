"""Schemas in IDL, as rosbag2 and DDS recorders write them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from log_making import fixes
from numpy.testing import assert_array_equal

from flightdyn.errors import LogError
from flightdyn.logs import list_sources, read_track
from flightdyn.logs.definitions import full_name, parse_definitions
from flightdyn.logs.mcap_container import Schema

Write = Callable[..., Path]
FIX = 'sensor_msgs/msg/NavSatFix'

# As rosidl generates it: directives, annotations with texts in pieces, typedefs, constants.
PARTS = {
    'sensor_msgs/msg/NavSatFix': r"""
// generated from rosidl_adapter/resource/msg.idl.em
#include "sensor_msgs/msg/NavSatStatus.idl"
#include "std_msgs/msg/Header.idl"

module sensor_msgs {
  module msg {
    typedef double double__9[9];
    module NavSatFix_Constants {
      @verbatim (language="comment", text=
        "Nothing is known." "\n"
        "# not a directive")
      const uint8 COVARIANCE_TYPE_UNKNOWN = 0;
    };
    @verbatim (language="comment", text=
      "A position" "\n" "" "\n"
      "on the ellipsoid")
    struct NavSatFix {
      std_msgs::msg::Header header;
      sensor_msgs::msg::NavSatStatus status;

      @verbatim (language="comment", text="Latitude [degrees].")
      @unit (value="degrees")
      double latitude;
      double longitude;
      double altitude;
      double__9 position_covariance;
      uint8 position_covariance_type;
    };
  };
};
""",
    'sensor_msgs/msg/NavSatStatus': """
module sensor_msgs {
  module msg {
    struct NavSatStatus {
      int8 status;
      uint16 service;
    };
  };
};
""",
    'std_msgs/msg/Header': """
#include "builtin_interfaces/msg/Time.idl"

module std_msgs {
  module msg {
    struct Header {
      builtin_interfaces::msg::Time stamp;
      string frame_id;
    };
  };
};
""",
    'builtin_interfaces/msg/Time': """
module builtin_interfaces {
  module msg {
    struct Time {
      int32 sec;
      uint32 nanosec;
    };
  };
};
""",
}
RULE = '=' * 80
TOGETHER = ''.join(f'{RULE}\nIDL: {name}\n{text}' for name, text in PARTS.items())


@pytest.mark.parametrize('little_endian', [True, False])
@pytest.mark.parametrize('encoding', ['ros2idl', 'omgidl'])
def test_a_log_with_idl_is_read_as_one_with_msg(
    write_log: Write, encoding: str, little_endian: bool
) -> None:
    messages = fixes(9, little_endian=little_endian)
    path = write_log(
        messages, texts={FIX: TOGETHER.encode()}, schema_encoding=encoding, name='idl.mcap'
    )
    track, plain = read_track(path), read_track(write_log(fixes(9)))
    for name in ('time_ns', 'lat', 'lon', 'altitude'):
        assert_array_equal(getattr(track, name), getattr(plain, name))
    assert np.ptp(plain.lat) > 0


@pytest.mark.parametrize('change', ['\r\n', 'no first rule'])
def test_ways_to_put_the_parts_together(change: str) -> None:
    text = TOGETHER.replace('\n', '\r\n') if change == '\r\n' else TOGETHER.split('\n', 2)[2]
    definitions = parse_definitions(Schema(1, FIX, 'ros2idl', text.encode()))
    assert set(PARTS) <= set(definitions)
    assert [field.size for field in definitions[FIX] if field.kind == 'array'] == [9]


def test_types_by_their_names_in_dds(write_log: Write) -> None:
    text = TOGETHER
    for name in PARTS:
        short = name.rsplit('/')[-1]
        text = text.replace(f'struct {short} {{', f'struct {short}_ {{')
        text = text.replace(f'::msg::{short} ', f'::msg::dds_::{short}_ ')
    text = text.replace('module msg {', 'module msg { module dds_ {')
    text = text.replace('  };\n};\n', '  };};\n};\n')
    assert 'builtin_interfaces::msg::dds_::Time_ stamp' in text
    name = 'sensor_msgs::msg::dds_::NavSatFix_'
    path = write_log(
        fixes(9), {'/fix': name}, texts={name: text.encode()}, schema_encoding='ros2idl'
    )
    (source,) = list_sources(path)
    assert (source.kind, source.schema, source.usable) == ('fix', name, True)
    assert len(read_track(path)) == 9


@pytest.mark.parametrize(
    'name', ['px4_msgs/SensorGps', 'px4_msgs::msg::SensorGps', 'px4_msgs::msg::dds_::SensorGps_']
)
def test_full_name(name: str) -> None:
    assert full_name(name) == 'px4_msgs/msg/SensorGps'


def test_idl_that_cannot_be_parsed_is_named() -> None:
    schema = Schema(1, FIX, 'ros2idl', TOGETHER.replace('double latitude', 'double 1').encode())
    with pytest.raises(LogError, match='schema sensor_msgs/msg/NavSatFix cannot be parsed'):
        parse_definitions(schema)
