/*
 * ptrace(2) that sets a traced process's extended registers as a whole.
 *
 * Linux takes them in one piece only, of the size that the processor has. The user-mode kernel knows
 * 2696 bytes, all up to AVX-512. On a processor with AMX the piece is longer and would be refused.
 * What the user-mode kernel does not know is set to what it is.
 */
enum { PTRACE_PEEKTEXT = 1, PTRACE_PEEKUSER = 3, GETREGSET = 0x4204, SETREGSET = 0x4205 };
enum { NT_X86_XSTATE = 0x202, SYS_PTRACE = 101 };

struct part { char *bytes; unsigned long length; };

long syscall(long number, ...);

long ptrace(long request, long process, long address, void *data)
{
	static char registers[1 << 16];
	struct part whole = { registers, sizeof registers };
	long word = 0, result;

	if (request == SETREGSET && address == NT_X86_XSTATE
	    && syscall(SYS_PTRACE, GETREGSET, process, address, &whole) == 0) {
		struct part *known = data;
		unsigned long i;

		for (i = 0; i < known->length && i < whole.length; i++)
			whole.bytes[i] = known->bytes[i];
		data = &whole;
	}
	/* the system call leaves a word that it peeks at where `data` points, the function returns it */
	if (request < PTRACE_PEEKTEXT || request > PTRACE_PEEKUSER)
		return syscall(SYS_PTRACE, request, process, address, data);
	result = syscall(SYS_PTRACE, request, process, address, &word);
	return result == 0 ? word : result;
}
