#pragma once
// The `$name` parameters of a Mitsuba scene: <default> elements and the values that override them.

#include <map>
#include <string>
#include <string_view>

#include "description/scene_description.h"

namespace etendue {

class SceneParameters {
public:
    explicit SceneParameters(const std::map<std::string, std::string>& overrides);

    /// Declares a <default> element. The first default of a name applies, unless it is overridden.
    void declare(const std::string& name, const std::string& value);
    /// `text` with every $name replaced by its value and "\$" by a dollar sign. A name is the
    /// longest run of letters, digits and '_'.
    std::string substitute(std::string_view text, const SourceLocation& where);
    /// Throws SceneError for an override of a parameter that the scene neither declares nor uses.
    void check_overrides(const std::string& scene_file) const;

private:
    struct Parameter {
        std::string value;
        bool overridden = false, known = false;
    };
    std::vector<std::string> known_names() const;

    std::map<std::string, Parameter, std::less<>> parameters_;
    size_t substituted_ = 0;  ///< Characters that replaced a $name so far.
};

}  // namespace etendue
