"""docs/nodes.md tells every parameter of the planner, every code, and an override that works."""

import re
from dataclasses import fields

import pytest
import yaml
from ros_support import ROOT, command, need_ros

need_ros()

from flightdyn.errors import ResultCode  # noqa: E402
from flightdyn.nodes.client import Session  # noqa: E402
from flightdyn.nodes.planner_node import PlannerParameters  # noqa: E402
from flightdyn.nodes.process import NodeProcess  # noqa: E402

TEXT = (ROOT / 'docs/nodes.md').read_text(encoding='utf-8')


def test_every_parameter_of_the_planner_is_told() -> None:
    told = set(re.findall(r'^\| `(\w+)` \|', TEXT, re.MULTILINE))
    assert {item.name for item in fields(PlannerParameters)} <= told


def test_every_code_is_told() -> None:
    told = re.findall(r'^\| `([A-Z_]+)` \|', TEXT, re.MULTILINE)
    assert told == [code.name for code in ResultCode]


def test_the_override_of_qos_works(
    ros: None, session: Session, tmp_path_factory: pytest.TempPathFactory
) -> None:
    (text,) = re.findall(r'^```yaml\n(.*?)^```', TEXT, re.MULTILINE | re.DOTALL)
    assert yaml.safe_load(text)
    file = tmp_path_factory.mktemp('params') / 'planner.yaml'
    file.write_text(text)
    started = [*command('planner'), '--ros-args', '--params-file', str(file)]
    with NodeProcess('planner', command=started):
        topic = '/planner/trajectory'
        session.wait_until(lambda: session.node.count_publishers(topic), 'the topic')
        (info,) = session.node.get_publishers_info_by_topic(topic)
        assert info.qos_profile.reliability.name == 'BEST_EFFORT'
