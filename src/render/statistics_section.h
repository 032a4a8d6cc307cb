#pragma once
// The sections "statistics" and "passes" of a checkpoint.

#include "pathspace/render_stats.h"
#include "render/render_report.h"
#include "system/section_file.h"

namespace etendue {

void save_statistics(const RenderStats& stats, double seconds, SectionWriter& to);
void load_statistics(SectionReader& from, RenderStats& stats, double& seconds);

void save_log(const PassLog& log, SectionWriter& to);
PassLog load_log(SectionReader& from);

}  // namespace etendue
