#pragma once
// The eye sub-paths of samples.

#include <span>

#include "pathspace/sample_context.h"

namespace etendue {

/// Traces the eye sub-path of a sample.
void trace_eye_path(const WalkContext& walk, const SampleContext& c, SubPath& z);
/// Traces the eye sub-path z[i] of each sample c[i], at most kWalksInTurn of them: the same paths in less time.
void trace_eye_paths(const WalkContext& walk, std::span<const SampleContext> c,
                     std::span<SubPath> z);

}  // namespace etendue
