#include "cli/app/app.h"
#include "cli/commands/commands.h"

int main(int argc, char** argv) { return alidade::cli::run_cli(argc, argv, alidade::cli::add_commands); }
