// Translation to Ceres and back; nothing of the physics.
extern "C" {
#include "fit/solve.h"
#include "fit/gauss_newton.h"
}
#include <algorithm>
#include <ceres/ceres.h>
#include <cmath>
#include <exception>
#include <new>
#include <vector>

namespace
{
class Residuals final : public ceres::CostFunction
{
  public:
    explicit Residuals(const alb_problem &problem) : problem_(problem)
    {
        set_num_residuals(problem.residual_count);
        mutable_parameter_block_sizes()->push_back(problem.parameter_count);
    }
    bool Evaluate(double const *const *parameters, double *residuals, double **jacobians) const override
    {
        double *jacobian = jacobians ? jacobians[0] : nullptr;
        problem_.evaluate(residuals, jacobian, parameters[0], problem_.context);
        for (int i = 0; i < problem_.residual_count; i++)
            if (!std::isfinite(residuals[i]))
                return false;
        for (int i = 0; jacobian && i < problem_.residual_count * problem_.parameter_count; i++)
            if (!std::isfinite(jacobian[i]))
                return false;
        return true;
    }

  private:
    const alb_problem &problem_;
};
} // namespace

static void descend(double *parameters, double *chi_square, const alb_problem &problem, double trust_radius)
{
    ceres::Problem ceres_problem;
    ceres_problem.AddResidualBlock(new Residuals(problem), nullptr, parameters);
    for (int i = 0; i < problem.parameter_count; i++) {
        ceres_problem.SetParameterLowerBound(parameters, i, problem.lower[i]);
        ceres_problem.SetParameterUpperBound(parameters, i, problem.upper[i]);
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.max_num_iterations = 3000;
    options.max_num_consecutive_invalid_steps = 100; // fewer are an error to Ceres, which it prints
    options.initial_trust_region_radius = trust_radius;
    options.function_tolerance = 1e-14;
    options.parameter_tolerance = 1e-12;
    options.gradient_tolerance = 1e-14;
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &ceres_problem, &summary);
    *chi_square = 2 * (summary.IsSolutionUsable() ? summary.final_cost : summary.initial_cost);
}

extern "C" bool alb_solve(double *parameters, double *chi_square, const alb_problem *problem, alb_error *error)
try {
    const double long_steps = 1e4, short_steps = 1e-4;
    std::vector<double> again(parameters, parameters + problem->parameter_count);
    bool full_rank;
    double reached;
    descend(parameters, chi_square, *problem, long_steps);
    if (!alb_gauss_newton(parameters, chi_square, &full_rank, problem, error))
        return false;
    if (full_rank)
        return true;
    descend(again.data(), &reached, *problem, short_steps);
    if (!alb_gauss_newton(again.data(), &reached, &full_rank, problem, error))
        return false;
    if (reached < *chi_square) {
        std::copy(again.begin(), again.end(), parameters);
        *chi_square = reached;
    }
    return true;
} catch (const std::bad_alloc &) {
    return alb_fail(error, ALB_NO_MEMORY, "out of memory while fitting");
} catch (const std::exception &exception) {
    return alb_fail(error, ALB_INTERNAL, "the solver failed: %s", exception.what());
}
