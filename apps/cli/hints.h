#pragma once
// What is probably meant by a command line that cannot be parsed.

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace etendue {

/// Replaces `help`, `help COMMAND` and `version`, as first words, by the options that mean the same; adds the command
/// `render` where a scene is given without a command of `app`.
std::vector<std::string> with_usual_words(const CLI::App& app, std::vector<std::string> arguments);

/// The message for `arguments` (without the name of the program) which `app` could not parse with the message `error`:
/// names the command or option that is nearest to what is unknown, and where to read more.
std::string refusal(const CLI::App& app, const std::vector<std::string>& arguments,
                    const std::string& error);

}  // namespace etendue
