#pragma once
// Lookup of the plug-in that an object of a description names, and the check of its parameters. Unknown names are
// errors, or warnings under `lenient`.

#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "description/params.h"

namespace etendue {

class PluginLookup {
public:
    PluginLookup(const SceneDescription& description, bool lenient)
        : description_(description), lenient_(lenient), left_out_(description.left_out),
          warnings_(description.warnings) {}

    const SceneDescription& description() const { return description_; }
    const SceneObject& object(int index) const { return description_.objects[size_t(index)]; }
    Params params(int index) const { return {description_, index}; }

    void warn(const SourceLocation& where, const std::string& message);
    /// Throws SceneError, or adds a warning that says what happens instead under `lenient`.
    void problem(const SourceLocation& where, const std::string& message,
                 const std::string& instead = "left out");
    /// Warnings of the description and of this object, in order; the last one counts what was left out.
    std::vector<std::string> warnings() const;

    void check(int index, const PluginInfo& info);

    /// The entry of the object's plug-in, after a check of its parameters; nullptr (under `lenient`) where it is
    /// unknown.
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

    /// Calls make(); exceptions other than SceneError get the location of the object.
    template <class Make>
    auto guarded(int index, const Make& make) {
        try {
            return make();
        } catch (const SceneError&) {
            throw;
        } catch (const std::bad_alloc&) {
            throw SceneError(object(index).where, "there is not enough memory for " +
                                                      object(index).category + " \"" +
                                                      object(index).type + "\"");
        } catch (const std::exception& e) {
            throw SceneError(object(index).where, e.what());
        }
    }

    /// guarded() of a make() whose result may be left out: under `lenient` an error is a warning, and the result is
    /// empty.
    template <class Make>
    auto attempt(int index, const Make& make) -> decltype(make()) {
        try {
            return guarded(index, make);
        } catch (const SceneError& e) {
            problem(e.where(), e.message());
            return {};
        }
    }

private:
    void report_unknown(int index, std::vector<std::string>& known);

    const SceneDescription& description_;
    bool lenient_;
    int left_out_;
    std::vector<std::string> warnings_;
};

}  // namespace etendue
