"""What can go wrong, and the one table that maps it to exit codes and action result codes."""

from enum import IntEnum
from typing import Any


class ResultCode(IntEnum):
    """Codes of `flightdyn_msgs/action/PlanTrajectory` results."""

    SUCCESS = 0
    BAD_REQUEST = 1
    INFEASIBLE = 2
    ITERATION_LIMIT = 3
    TIME_LIMIT = 4
    CANCELLED = 5
    NOT_VERIFIED = 6
    INTERNAL = 7


EXIT_CODES = {
    ResultCode.SUCCESS: 0,
    ResultCode.BAD_REQUEST: 2,
    ResultCode.INFEASIBLE: 3,
    ResultCode.ITERATION_LIMIT: 3,
    ResultCode.TIME_LIMIT: 3,
    ResultCode.CANCELLED: 130,
    ResultCode.NOT_VERIFIED: 4,
    ResultCode.INTERNAL: 1,
}


class FlightdynError(Exception):
    """Base of every error raised on purpose; the message says what, where and what is right."""

    result_code = ResultCode.INTERNAL

    @property
    def exit_code(self) -> int:
        return EXIT_CODES[self.result_code]


class InputError(FlightdynError):
    """A request, file or value from outside that cannot be used."""

    result_code = ResultCode.BAD_REQUEST


class LogError(InputError):
    """A flight log that cannot be read; the message names the file and the byte or message."""


class NotConvergedError(FlightdynError):
    """A solve that ended without a solution; `last` is where it stood, marked unconverged."""

    result_code = ResultCode.INFEASIBLE

    def __init__(self, message: str, code: ResultCode, last: Any) -> None:
        super().__init__(message)
        self.result_code = code
        self.last = last


class MissingExtraError(InputError):
    """An optional dependency is needed for what was asked."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(f"{what} needs the extra '{extra}': pip install 'flightdyn[{extra}]'")
