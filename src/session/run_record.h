#pragma once
// The section "session" of a checkpoint: what the page shows of a run beyond the state of its rendering.

#include "session/session.h"
#include "system/section_file.h"

namespace etendue {

/// Writes limits, numbers of seeds, history and figures.
void save_record(const RunStatus& run, SectionWriter& to);
/// Reads them, and whether the run has finished or was stopped. False if the file has none, as that of another command.
bool load_record(SectionReader& from, RunStatus& run);

}  // namespace etendue
