"""A small sweep."""

TEXT = """\
chain: {n: 3, delta: 6.0e-3, beta: -1.0}
setting:
  epsilon: {from: 1.0e-4, to: 1.0e-3, steps: 5, log: true}
  lam: 6.0e-3
  omega: {from: 0.99, to: 1.01, steps: 4}
rung: harmonic_balance
tol: 1.0e-8
"""
