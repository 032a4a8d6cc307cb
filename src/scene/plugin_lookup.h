#pragma once
// From an object of a description to the plug-in that it names, its parameters checked; what is unknown is an error, or,
// under `lenient`, a warning.

#include <string>
#include <string_view>
#include <vector>

#include "description/params.h"

namespace etendue {

class PluginLookup {
public:
    PluginLookup(const SceneDescription& description, bool lenient)
        : description_(description), lenient_(lenient), warnings_(description.warnings) {}

    const SceneDescription& description() const { return description_; }
    const SceneObject& object(int index) const { return description_.objects[size_t(index)]; }
    Params params(int index) const { return {description_, index}; }

    void warn(const SourceLocation& where, const std::string& message);
    /// An error, or under `lenient` a warning.
    void problem(const SourceLocation& where, const std::string& message);
    /// The description's, and those since.
    const std::vector<std::string>& warnings() const { return warnings_; }

    void check(int index, const PluginInfo& info);

    /// The entry of the object's plug-in, its parameters checked; nullptr (under `lenient`) where there is none.
    template <class Entry>
    const Entry* find(int index, const std::vector<Entry>& registry) {
        std::vector<std::string> known;
        for (const Entry& e : registry) {
            if (object(index).type == e.info.name) {
                check(index, e.info);
                return &e;
            }
            known.push_back(e.info.name);
        }
        report_unknown(index, known);
        return nullptr;
    }

    /// Calls a maker; what it says without a place is put at the object's.
    template <class Make>
    auto guarded(int index, const Make& make) {
        try {
            return make();
        } catch (const SceneError&) {
            throw;
        } catch (const std::exception& e) {
            throw SceneError(object(index).where, e.what());
        }
    }

private:
    void report_unknown(int index, std::vector<std::string>& known);

    const SceneDescription& description_;
    bool lenient_;
    std::vector<std::string> warnings_;
};

}  // namespace etendue
