// Any bytes as the text of an integrator: a std::runtime_error, or an integrator whose text gives it again.

#include <stdexcept>

#include "fuzz_target.h"
#include "integrator/integrator.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view bytes) {
    try {
        const IntegratorSpec spec = IntegratorSpec::parse(std::string(bytes));
        require(IntegratorSpec::parse(spec.to_string()).to_string() == spec.to_string());
        make_integrator(spec);
    } catch (const std::runtime_error&) {
    }
}

const Register kRegister({.name = "integrator", .run = run});

}  // namespace
}  // namespace etendue::fuzz
