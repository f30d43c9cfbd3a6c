// Reads states from stdin, prints what the plugin computes as hexadecimal numbers.
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <inverse_dynamics_solver/inverse_dynamics_solver.hpp>
extern "C" inverse_dynamics_solver::InverseDynamicsSolver * make_plugin();
static void print(const Eigen::VectorXd & values)
{
  for (int k = 0; k < values.size(); ++k) {
    std::printf("%a ", values(k));
  }
}
int main(int argc, char **)
{
  std::unique_ptr<inverse_dynamics_solver::InverseDynamicsSolver> solver(make_plugin());
  auto parameters = std::make_shared<rclcpp::node_interfaces::NodeParametersInterface>();
  parameters->values["s.damping"] = {};  // empty: the identified values stay
  if (argc > 1) {
    parameters->values["s.damping"] = {1.0};
  }
  int n = 0, count = 0;
  if (std::scanf("%d %d", &n, &count) != 2) {
    return 1;
  }
  try {
    solver->initialize(parameters, "s");
  } catch (const std::invalid_argument & error) {
    std::puts(error.what());
    return 0;
  }
  for (int k = 0; k < count; ++k) {
    Eigen::VectorXd state[3] = {Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n)};
    for (auto & part : state) {
      for (int j = 0; j < n; ++j) {
        if (std::scanf("%lf", &part(j)) != 1) {
          return 1;
        }
      }
    }
    print(solver->getTorques(state[0], state[1], state[2]));
    print(solver->getCoriolisVector(state[0], state[1]));
    print(solver->getGravityVector(state[0]));
    print(solver->getFrictionVector(state[1]));
    const Eigen::MatrixXd mass = solver->getInertiaMatrix(state[0]);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        std::printf("%a ", mass(i, j));
      }
    }
    std::puts("");
  }
  return 0;
}
