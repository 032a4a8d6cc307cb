#pragma once
// The section "session" of a checkpoint: what the page shows of a run beyond the state of its rendering.

#include "session/session.h"
#include "session/snapshot.h"
#include "system/section_file.h"

namespace etendue {

/// Writes limits, numbers of seeds, history and figures.
void save_record(const RunStatus& run, SectionWriter& to);
/// Reads them, and whether the run has finished or was stopped. False if the file has none, as that of another command.
bool load_record(SectionReader& from, RunStatus& run);

/// What the section of a run with several seeds begins with.
struct SavedSeeds {
    uint64_t first = 0;       ///< The first seed.
    bool is_counted = false;  ///< Whether the file's film is among the finished ones.
    SeedMean mean;            ///< Of the finished ones.
};
/// Begins the section "seeds".
void begin_seeds(uint64_t first, bool is_counted, const SeedMean& mean, SectionWriter& to);
/// Opens it. Throws std::runtime_error unless it has `finished` seeds with so many pixels.
SavedSeeds open_seeds(SectionReader& from, uint64_t pixels, int finished);

}  // namespace etendue
