#pragma once
// Values of scene parameters as Python objects, and back.

#include <initializer_list>
#include <optional>
#include <string>

#include "bindings.h"
#include "description/params.h"

namespace etendue::python {

/// The table of the plug-in that a scene file names so; nullptr where there is none.
const PluginInfo* find_plugin(const std::string& category, const std::string& type);
/// The category of the plug-in with this name. Throws SceneError where there is none.
std::string category_of(const std::string& type, const SourceLocation& where);

/// Whether a dict stands for a value, such as {"type": "rgb", "value": ...}, and not for an object.
bool is_value(nb::handle value);

/// Where a value is used.
struct ValueContext {
    std::string category, parameter;
    std::optional<ParamKind> kind;  ///< Empty where the table does not have the parameter.
    bool in_emitter = false;
    SourceLocation where;
};
/// Numbers, texts, colours (3 numbers, {"type": "rgb"}, {"type": "spectrum"}), vectors and 4×4 matrices. Throws SceneError.
ParamValue to_value(nb::handle value, const ValueContext& context);
nb::object to_python(const ParamValue& value);

/// Raises ValueError unless all values that are given are above 0. `names`: of the arguments, for the message.
void check_above_0(const char* names, std::initializer_list<std::optional<double>> values);
/// The value of an argument. Raises ValueError unless it lies in [low, high].
int checked(const char* name, int value, int low, int high);
/// The same for a number of threads, where 0 stands for one per core.
inline int checked_threads(int threads) {
    return checked("threads", threads, 0, 4096);
}

}  // namespace etendue::python
