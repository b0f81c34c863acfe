"""Configuration files: what is refused, and how it is said."""

from pathlib import Path
from typing import Any

import pytest

from flightdyn import config, resources
from flightdyn.errors import EXIT_CODES, InputError, ResultCode


def test_every_result_code_has_an_exit_code() -> None:
    assert set(EXIT_CODES) == set(ResultCode)


def test_angles_may_be_given_in_degrees() -> None:
    assert config.number('-360 deg', 'theta') == pytest.approx(-6.283185307179586)


@pytest.mark.parametrize('value', ['fast', None, [1], True, float('nan'), float('inf')])
def test_what_is_no_finite_number_is_refused(value: Any) -> None:
    with pytest.raises(InputError, match='speed: '):
        config.number(value, 'speed')


def test_bounds_may_be_open() -> None:
    assert config.bounds([None, 3], 'x') == (-float('inf'), 3)
    assert config.bounds(2, 'x') == (2, 2)


@pytest.mark.parametrize('value', [[3, 2], [1, 2, 3], [1], 'x'])
def test_bounds_out_of_order_or_shape_are_refused(value: Any) -> None:
    with pytest.raises(InputError, match='x: '):
        config.bounds(value, 'x')


def test_unknown_key_names_the_nearest() -> None:
    with pytest.raises(InputError, match="unknown 'mas', did you mean 'mass'"):
        config.check_keys({'mas': 1}, ('mass', 'inertia'), 'file')


def test_broken_yaml_says_where(tmp_path: Path) -> None:
    path = tmp_path / 'broken.yaml'
    path.write_text('a: [1, 2\nb: 3\n')
    with pytest.raises(InputError, match=r'broken.yaml.*line 2'):
        config.load_yaml(path)


def test_a_document_read_twice_is_two() -> None:
    first = config.parse_yaml('a: {b: [1]}', 'here')
    first['a']['b'].append(2)
    assert config.parse_yaml('a: {b: [1]}', 'here') == {'a': {'b': [1]}}


def test_yaml_cannot_run_code(tmp_path: Path) -> None:
    path = tmp_path / 'evil.yaml'
    path.write_text('a: !!python/object/apply:os.getcwd []\n')
    with pytest.raises(InputError, match=r'evil.yaml'):
        config.load_yaml(path)


def test_own_config_dir_comes_first(tmp_path: Path) -> None:
    (tmp_path / 'vehicles').mkdir()
    own = tmp_path / 'vehicles' / 'quadcopter.yaml'
    own.write_text('mass: 1\n')
    assert resources.find_config('vehicles', 'quadcopter', tmp_path) == own
    assert resources.find_config('problems', 'quadcopter_flip', tmp_path).is_file()


def test_unknown_name_lists_the_known() -> None:
    with pytest.raises(InputError, match=r'known: .*quadcopter_flip'):
        resources.find_config('problems', 'quadcopter_flop')


def test_a_name_cannot_leave_the_folder() -> None:
    with pytest.raises(InputError, match='no vehicle'):
        resources.find_config('vehicles', '../problems/quadcopter_flip')
