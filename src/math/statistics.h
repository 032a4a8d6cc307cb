#pragma once
// Quantiles of sampling distributions.

namespace etendue {

/// Two-sided 95 % quantile of the normal distribution.
inline constexpr double kNormalQuantile95 = 1.959964;

/// Two-sided 95 % quantile of Student's t, within 1 % [Abramowitz & Stegun 1964, 26.7.5].
constexpr double t_quantile_95(double dof) {
    // The series is poor for the fewest degrees of freedom.
    if (dof < 1.5) return 12.706;
    if (dof < 2.5) return 4.303;
    const double z = kNormalQuantile95, z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
    return z + (z3 + z) / (4 * dof) + (5 * z5 + 16 * z3 + 3 * z) / (96 * dof * dof) +
           (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / (384 * dof * dof * dof);
}

}  // namespace etendue
