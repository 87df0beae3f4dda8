// Chains from rest by Boost.odeint. Arguments: delta, periods, tolerance; a line "epsilon lam omega" each on stdin.
// Prints the processor seconds taken, then z and v of every chain.
#include <array>
#include <boost/numeric/odeint.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <vector>

constexpr int n = 6;
using State = std::array<double, 2 * n>;

int main(int, char **argv) {
    namespace ode = boost::numeric::odeint;
    const double delta = std::atof(argv[1]), periods = std::atof(argv[2]), tolerance = std::atof(argv[3]);
    std::vector<State> ends;
    double epsilon, lam, omega, seconds = 0;
    while (std::cin >> epsilon >> lam >> omega) {
        auto slope = [&](const State &y, State &out, double tau) {
            for (int m = 0; m < n; ++m) {
                const double z = y[m], push = m ? lam * (y[m - 1] - z) : epsilon * std::cos(omega * tau);
                out[m] = y[n + m];
                out[n + m] = push - delta * y[n + m] - z + z * z * z;
            }
        };
        State y{};
        auto stepper = ode::make_controlled(tolerance / 100, tolerance, ode::runge_kutta_fehlberg78<State>());
        const std::clock_t began = std::clock();
        ode::integrate_adaptive(stepper, slope, y, 0.0, periods * 2 * M_PI / omega, 0.1);
        seconds += double(std::clock() - began) / CLOCKS_PER_SEC;
        ends.push_back(y);
    }
    std::printf("%.9g\n", seconds);
    for (const auto &y : ends)
        for (double x : y) std::printf("%.17g ", x);
}
