extern "C" {
#include "ceres_baseline.h"
}
#include <ceres/ceres.h>
#include <cmath>
#include <limits>

namespace
{
struct Reading {
    double r, value, sd;
    template <typename T> bool operator()(const T *p, T *residual) const
    {
        using std::exp;
        residual[0] = (p[0] * exp(-p[1] * r) + p[2] * exp(-p[3] * r) - value) / sd;
        return ceres::isfinite(residual[0]); // else Ceres prints it
    }
};

class Block final : public ceres::CostFunction
{
  public:
    Block(const double *r, const double *value, const double *sd, int count) : r_(r), value_(value), sd_(sd)
    {
        set_num_residuals(count);
        mutable_parameter_block_sizes()->push_back(4);
    }
    bool Evaluate(double const *const *parameters, double *residuals, double **jacobians) const override
    {
        const double *p = parameters[0];
        for (int i = 0; i < num_residuals(); i++) {
            const double e = std::exp(-p[1] * r_[i]) / sd_[i], f = std::exp(-p[3] * r_[i]) / sd_[i];
            residuals[i] = p[0] * e + p[2] * f - value_[i] / sd_[i];
            if (!std::isfinite(residuals[i]))
                return false;
            if (jacobians) {
                double *row = jacobians[0] + 4 * i;
                row[0] = e;
                row[1] = -p[0] * r_[i] * e;
                row[2] = f;
                row[3] = -p[2] * r_[i] * f;
            }
        }
        return true;
    }

  private:
    const double *r_, *value_, *sd_;
};
} // namespace

extern "C" void ceres_baseline(double parameters[4], double *chi_square, const double *r_mm, const double *value,
                               const double *sd, int count, bool one_block, int iterations)
{
    ceres::Problem problem;
    if (one_block)
        problem.AddResidualBlock(new Block(r_mm, value, sd, count), nullptr, parameters);
    for (int i = 0; !one_block && i < count; i++)
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Reading, 1, 4>(new Reading{r_mm[i], value[i], sd[i]}),
                                 nullptr, parameters);
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = iterations;
    options.max_num_consecutive_invalid_steps = 100;
    if (one_block)
        options.linear_solver_type = ceres::DENSE_QR;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    *chi_square = summary.IsSolutionUsable() ? 2 * summary.final_cost : std::numeric_limits<double>::infinity();
}
