#pragma once
// The default reference of a comparison.

#include <string>
#include <vector>

#include "compare/comparison.h"

namespace etendue {

/// bdpt, with the methods' max_depth where they agree on it.
IntegratorSpec reference_integrator(const Scene& scene, const std::vector<MethodSpec>& methods);
/// Ten times the time of a method, or 16 times its samples.
RenderLimits reference_limits(const RenderLimits& of_method);
/// A sentence for each method whose longest paths are not those of the reference.
std::vector<std::string> depth_warnings(const std::vector<MethodSpec>& methods,
                                        const IntegratorSpec& reference);

}  // namespace etendue
