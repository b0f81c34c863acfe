"""A function at many points, operation by operation.

CasADi's interpreter takes longer to see what is to be done than to do it, one number at a time.
With vectors of all points instead of numbers it does many for each look: at a hundred points a
sixth of the time, where there is no C compiler. The numbers are the same.
"""

import casadi as cas

MANY = 24  # points; the fewer there are, the less is saved for the time of writing it down
LONGEST = 100_000  # operations; each takes ten microseconds to write down


def can_be_spread(function: cas.Function) -> bool:
    """Return whether a function is a list of operations on numbers, and not too long a one."""
    if not function.is_a('SXFunction') or function.n_instructions() > LONGEST:
        return False
    return all(function.instruction_id(k) != cas.OP_CALL for k in range(function.n_instructions()))


def spread(function: cas.Function, n: int) -> cas.Function:
    """Return what `function.map(n)` is."""
    inputs = [cas.MX.sym(f'i{i}', function.nnz_in(i), n) for i in range(function.n_in())]
    rows = [cas.vertsplit(each) for each in inputs]
    outputs = [[cas.MX()] * function.nnz_out(i) for i in range(function.n_out())]
    work = [cas.MX()] * function.sz_w()
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        given, made = function.instruction_input(k), function.instruction_output(k)
        if operation == cas.OP_OUTPUT:
            outputs[made[0]][made[1]] = _row(work[given[0]], n)
        elif operation == cas.OP_INPUT:
            work[made[0]] = rows[given[0]][given[1]]
        elif operation == cas.OP_CONST:
            work[made[0]] = cas.MX(function.instruction_constant(k))
        elif len(given) == 1:
            work[made[0]] = cas.MX.unary(operation, work[given[0]])
        else:
            work[made[0]] = cas.MX.binary(operation, work[given[0]], work[given[1]])
    values = []
    for i, found in enumerate(outputs):
        pattern = cas.repmat(function.sparsity_out(i), 1, n)
        values.append(cas.MX(pattern, cas.vec(cas.vertcat(*found))))
    return cas.Function(f'{function.name()}_spread', inputs, values)


def _row(value: cas.MX, n: int) -> cas.MX:
    """Return a value at n points, which may be the same number at all of them."""
    return value if value.size2() == n else cas.repmat(value, 1, n)
