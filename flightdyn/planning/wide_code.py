"""C source of a function at several points at once.

Processors add and multiply several numbers in the time of one. A function of scalars is a list of
such operations; written with vectors of GCC's and Clang's extension, each does them for as many
points. Every lane has the very numbers that CasADi's interpreter finds.
"""

import casadi as cas

from ..errors import InputError

PRELUDE = """
#include <math.h>
#define INLINE static inline __attribute__((always_inline))
typedef double v __attribute__((vector_size(8 * N)));
typedef long long mask __attribute__((vector_size(8 * N)));
INLINE v pick(mask c, v a, v b) { return (v)((c & (mask)a) | (~c & (mask)b)); }
INLINE v flag(mask c) { return (v)(c & (mask)all(1.0)); }
INLINE v load(const double *p, int step) {
  v r; for (int l = 0; l < N; l++) r[l] = p[l * step]; return r; }
INLINE void store(double *p, int step, v a) { for (int l = 0; l < N; l++) p[l * step] = a[l]; }
"""
ONE_BY_ONE = (
    'static v each_{0}(v a) {{ for (int l = 0; l < N; l++) a[l] = {0}(a[l]); return a; }}\n'
)
TWO_BY_TWO = (
    'static v each_{0}(v a, v b) {{ '
    'for (int l = 0; l < N; l++) a[l] = {0}(a[l], b[l]); return a; }}\n'
)

LIBRARY_OF_ONE = {
    getattr(cas, f'OP_{name.upper()}'): name
    for name in (
        *('exp', 'log', 'sqrt', 'sin', 'cos', 'tan', 'asin', 'acos', 'atan', 'floor', 'ceil'),
        *('fabs', 'erf', 'sinh', 'cosh', 'tanh', 'asinh', 'acosh', 'atanh', 'log1p', 'expm1'),
    )
}
LIBRARY_OF_TWO = {
    getattr(cas, f'OP_{name.upper()}'): name
    for name in ('pow', 'fmod', 'copysign', 'atan2', 'hypot', 'remainder')
} | {cas.OP_CONSTPOW: 'pow'}
OPERATIONS: dict[int, str] = {
    cas.OP_ASSIGN: '{0}',
    cas.OP_ADD: '{0} + {1}',
    cas.OP_SUB: '{0} - {1}',
    cas.OP_MUL: '{0} * {1}',
    cas.OP_DIV: '{0} / {1}',
    cas.OP_NEG: '-{0}',
    cas.OP_SQ: '{0} * {0}',
    cas.OP_TWICE: '{0} + {0}',
    cas.OP_INV: 'all(1.0) / {0}',
    cas.OP_LT: 'flag({0} < {1})',
    cas.OP_LE: 'flag({0} <= {1})',
    cas.OP_EQ: 'flag({0} == {1})',
    cas.OP_NE: 'flag({0} != {1})',
    cas.OP_NOT: 'flag({0} == all(0.0))',
    cas.OP_AND: 'flag(({0} != all(0.0)) & ({1} != all(0.0)))',
    cas.OP_OR: 'flag(({0} != all(0.0)) | ({1} != all(0.0)))',
    cas.OP_IF_ELSE_ZERO: 'pick({0} != all(0.0), {1}, all(0.0))',
    # a number and not-a-number: the number
    cas.OP_FMIN: 'pick(({0} < {1}) | ({1} != {1}), {0}, {1})',
    cas.OP_FMAX: 'pick(({0} > {1}) | ({1} != {1}), {0}, {1})',
    cas.OP_SIGN: 'pick({0} > all(0.0), all(1.0), pick({0} < all(0.0), all(-1.0), {0}))',
    **{op: f'each_{name}({{0}})' for op, name in LIBRARY_OF_ONE.items()},
    **{op: f'each_{name}({{0}}, {{1}})' for op, name in LIBRARY_OF_TWO.items()},
}


def can_be_wide(function: cas.Function) -> bool:
    """Return whether each of a function's operations is one that has a vector form."""
    if not function.is_a('SXFunction'):
        return False
    known = {*OPERATIONS, cas.OP_CONST, cas.OP_INPUT, cas.OP_OUTPUT}
    return all(function.instruction_id(k) in known for k in range(function.n_instructions()))


def wide_name(function: cas.Function) -> str:
    """Return what the wide function is called in its library."""
    return f'{function.name()}_wide'


def wide_source(function: cas.Function, lanes: int) -> str:
    """Return C source of `wide_name(function)`, for `casadi.external`.

    It takes and returns what `function.map(lanes)` does: points side by side.

    Raises
    ------
    InputError
        An operation has no vector form: see `can_be_wide`.
    """
    if not can_be_wide(function):
        raise InputError(f'{function.name()}: has operations that are not of single numbers')
    name = wide_name(function)
    inputs = [function.sparsity_in(i) for i in range(function.n_in())]
    outputs = [function.sparsity_out(i) for i in range(function.n_out())]
    variables, lines = _operations(function)
    return ''.join(
        [
            f'#define N {lanes}\n#define all(a) ((v){{{", ".join(["a"] * lanes)}}})',
            PRELUDE,
            *map(ONE_BY_ONE.format, LIBRARY_OF_ONE.values()),
            *map(TWO_BY_TWO.format, dict.fromkeys(LIBRARY_OF_TWO.values())),
            f'int {name}(const double **arg, double **res, long long *iw, double *w, int m) {{\n',
            *(f'  const double *i{i} = arg[{i}];\n' for i in range(len(inputs))),
            *(f'  double *o{i} = res[{i}];\n' for i in range(len(outputs))),
            *(f'  v {variable};\n' for variable in variables),
            *(f'  {line};\n' for line in lines),
            '  return 0;\n}\n',
            f'long long {name}_n_in(void) {{ return {len(inputs)}; }}\n',
            f'long long {name}_n_out(void) {{ return {len(outputs)}; }}\n',
            _sparsities(f'{name}_sparsity_in', inputs, lanes),
            _sparsities(f'{name}_sparsity_out', outputs, lanes),
        ]
    )


def _operations(function: cas.Function) -> tuple[list[str], list[str]]:
    """Return the variables and the statements of a function."""
    variables: dict[str, None] = {}
    lines = []
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        given, made = function.instruction_input(k), function.instruction_output(k)
        if operation == cas.OP_OUTPUT:
            step = function.nnz_out(made[0])
            lines.append(f'if (o{made[0]}) store(o{made[0]} + {made[1]}, {step}, a{given[0]})')
            continue
        variable = f'a{made[0]}'
        variables[variable] = None
        if operation == cas.OP_INPUT:
            step = function.nnz_in(given[0])
            value = f'i{given[0]} ? load(i{given[0]} + {given[1]}, {step}) : all(0.0)'
        elif operation == cas.OP_CONST:
            value = f'all({_number(function.instruction_constant(k))})'
        else:
            value = OPERATIONS[operation].format(*(f'a{place}' for place in given))
        lines.append(f'{variable} = {value}')
    return list(variables), lines


def _number(value: float) -> str:
    return {'inf': 'INFINITY', '-inf': '-INFINITY', 'nan': 'NAN'}.get(repr(value), repr(value))


def _sparsities(name: str, single: list[cas.Sparsity], lanes: int) -> str:
    """Return a function that gives CasADi the sparsity patterns of inputs or outputs."""
    cases = []
    for i, one in enumerate(single):
        several = cas.repmat(one, 1, lanes)
        numbers = [several.size1(), several.size2(), *several.colind(), *several.row()]
        listed = ', '.join(map(str, numbers))
        cases.append(
            f'  static const long long s{i}[] = {{{listed}}};\n  if (i == {i}) return s{i};\n'
        )
    return f'const long long *{name}(long long i) {{\n{"".join(cases)}  return 0;\n}}\n'
