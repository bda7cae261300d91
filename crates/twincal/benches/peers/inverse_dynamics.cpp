// Pinocchio's time per call of rnea and computeJointTorqueRegressor, from C++; built and called by inverse_dynamics.py.
//
// Prints both in ns, the least of the repeats. Every state is another one, as in a log; Data is reused, nothing is
// allocated in the loop. The algorithms are those compiled into the wheel (double, default joints).
#include <pinocchio/multibody.hpp>
#include <pinocchio/serialization.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <ctime>
#include <iostream>
#include <limits>
#include <random>
#include <vector>

namespace
{
  constexpr int samples = 1000;
  constexpr int repeats = 60;

  double now()
  {
    timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * double(t.tv_sec) + double(t.tv_nsec);
  }

  template<typename Work>
  double least(Work work)
  {
    double best = std::numeric_limits<double>::infinity();
    for (int repeat = 0; repeat < repeats; ++repeat)
    {
      const double start = now();
      for (int s = 0; s < samples; ++s)
        work(s);
      best = std::min(best, (now() - start) / samples);
    }
    return best;
  }
} // namespace

int main(int count, char ** arguments)
{
  if (count != 2)
    return 2;
  pinocchio::Model model;
  model.loadFromBinary(std::string(arguments[1]));
  pinocchio::Data data(model);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  auto draw = [&](int size) {
    Eigen::VectorXd v(size);
    for (int i = 0; i < size; ++i)
      v[i] = uniform(random);
    return v;
  };
  std::vector<Eigen::VectorXd> q, v, a;
  for (int s = 0; s < samples; ++s)
  {
    // A continuous joint is a point on the unit circle.
    Eigen::VectorXd at = pinocchio::neutral(model);
    q.push_back(pinocchio::integrate(model, at, draw(model.nv)));
    v.push_back(draw(model.nv));
    a.push_back(draw(model.nv));
  }
  double sink = 0;
  const double rnea = least([&](int s) { sink += pinocchio::rnea(model, data, q[s], v[s], a[s])[0]; });
  const double regressor = least([&](int s) {
    sink += pinocchio::computeJointTorqueRegressor(model, data, q[s], v[s], a[s])(0, 9);
  });
  std::cout << rnea << " " << regressor << "\n";
  return sink == sink ? 0 : 1;
}
