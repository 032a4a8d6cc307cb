#pragma once
// The plug-ins and parameters of surface scenes that the manuals of Mitsuba 0.6 and of Mitsuba 3 document, and what
// etendue does with each. The plug-ins' own tables say what is supported; this table adds what is not, with the reason.

#include <string>
#include <string_view>
#include <vector>

#include "description/params.h"

namespace etendue {

/// Manuals, as bits.
inline constexpr int kMitsuba06 = 1, kMitsuba3 = 2, kBothManuals = kMitsuba06 | kMitsuba3;

/// A documented parameter that the plug-in's own table does not have.
struct ManualNote {
    const char* names;  ///< Separated by blanks.
    bool is_accepted;   ///< Whether it is read without effect; otherwise it is refused.
    const char* text;   ///< Why.
};

struct ManualEntry {
    const char* category;
    const char* name;
    int manuals;
    /// Documented parameters, separated by blanks: in all of the entry's manuals, and in one of them only.
    const char* params;
    const char* params_06 = "";
    const char* params_3 = "";
    std::vector<ManualNote> notes = {};
    /// Why the plug-in is refused; nullptr where it is supported.
    const char* refused = nullptr;
    /// The plug-in with which the reader replaces it, whose table applies; nullptr where it keeps its name.
    const char* replacement = nullptr;
};

const std::vector<ManualEntry>& mitsuba_manual();

/// The entry of a plug-in; nullptr where no manual has it.
const ManualEntry* find_manual_entry(std::string_view category, std::string_view name);
/// The note on a parameter of a plug-in, if there is one.
const ManualNote* find_manual_note(std::string_view category, std::string_view plugin,
                                   std::string_view param);

/// The whole table in Markdown, with the columns 0.6, 3 and etendue. `plugins`: tables of what is supported.
std::string mitsuba_manual_table(const std::vector<PluginInfo>& plugins);

}  // namespace etendue
