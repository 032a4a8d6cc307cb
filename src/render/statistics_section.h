#pragma once
// The section "statistics" of a checkpoint.

#include "pathspace/render_stats.h"
#include "system/section_file.h"

namespace etendue {

void save_statistics(const RenderStats& stats, double seconds, SectionWriter& to);
void load_statistics(SectionReader& from, RenderStats& stats, double& seconds);

}  // namespace etendue
