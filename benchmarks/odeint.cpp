// LANES chains side by side by Boost.odeint, as a library; rows as in chain_rows.py. STEPPER is 0 for a controlled
// Runge-Kutta-Fehlberg 7(8), 1 for Bulirsch and Stoer.
#include <array>
#include <boost/numeric/odeint.hpp>
#include <cmath>

constexpr int n = 6, lanes = LANES;

template <int rows> struct Chains {
    using State = std::array<double, rows * lanes>;
    double delta;
    const double *epsilon, *lam, *rate;

    void operator()(const State &y, State &out, double phase) const {
        const double pull = std::cos(phase);
        for (int m = 0; m < n; ++m) {
            const double *z = &y[2 * m * lanes], *v = z + lanes;
            double *dz = &out[2 * m * lanes], *dv = dz + lanes;
            for (int w = 0; w < lanes; ++w) {
                const double push = m ? lam[w] * (z[w - 2 * lanes] - z[w]) : epsilon[w] * pull;
                dz[w] = rate[w] * v[w];
                dv[w] = rate[w] * (push - delta * v[w] - z[w] + z[w] * z[w] * z[w]);
            }
        }
        int row = 2 * n;
        for (int j = 0; j < n && row < rows; ++j)
            for (int k = 0; k < 2; ++k)
                for (int m = j; m < n; ++m, row += 2) {
                    const double *z = &y[2 * m * lanes], *u = &y[row * lanes], *du = u + lanes;
                    double *out_u = &out[row * lanes], *out_du = out_u + lanes;
                    for (int w = 0; w < lanes; ++w) {
                        double push = m ? -lam[w] * u[w] : 0;
                        if (m > j) push += lam[w] * u[w - 2 * lanes];
                        out_u[w] = rate[w] * du[w];
                        out_du[w] = rate[w] * (push - delta * du[w] + (3 * z[w] * z[w] - 1) * u[w]);
                    }
                }
    }
};

template <int rows> void flow(double *y, const double *given, double delta, double periods, double tolerance) {
    namespace ode = boost::numeric::odeint;
    using State = typename Chains<rows>::State;
    const Chains<rows> chains{delta, given, given + lanes, given + 2 * lanes};
    State state;
    std::copy(y, y + rows * lanes, state.begin());
    const double end = periods * 2 * M_PI, first = 0.1;
#if STEPPER
    ode::bulirsch_stoer<State> stepper(tolerance / 100, tolerance);
#else
    auto stepper = ode::make_controlled(tolerance / 100, tolerance, ode::runge_kutta_fehlberg78<State>());
#endif
    ode::integrate_adaptive(stepper, chains, state, 0.0, end, first);
    std::copy(state.begin(), state.end(), y);
}

extern "C" void flow_states(double *y, const double *given, double delta, double periods, double tolerance) {
    flow<2 * n>(y, given, delta, periods, tolerance);
}

extern "C" void flow_varied(double *y, const double *given, double delta, double periods, double tolerance) {
    flow<2 * n + 2 * n * (n + 1)>(y, given, delta, periods, tolerance);
}
